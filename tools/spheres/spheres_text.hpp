#pragma once

#include <string>
#include <vector>

#include <sidestep/core/node.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// A profile's text with these spheres in its list `spheres`. Lines of spheres that stay, comments
/// and everything else are left as they are; a sphere that was changed stands where it stood, a new
/// one behind the last of its link. `document` is what `text` says. [any]; allocates.
[[nodiscard]] std::string with_spheres(const std::string& text, const Node& document,
                                       const std::vector<Link>& links,
                                       const std::vector<CollisionSphere>& spheres);

/// The text with the scalar at `mark` replaced by a quoted path.
[[nodiscard]] std::string with_path(const std::string& text, const Node& scalar,
                                    const std::string& path);

}  // namespace sidestep
