#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/node.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// A robot profile whose spheres are looked at and replaced. Reads and writes these files alone:
/// the profile, or, with `out`, the profile and that file. [any one thread]
class SphereProfile {
 public:
  /// `name`: as a configuration names a profile. `out`: spheres are saved into this new file
  /// instead. Fails as the profile's loading does, and with kIo where `out` exists. The context
  /// outlives it.
  [[nodiscard]] static Result<SphereProfile> open(const std::string& name,
                                                  const std::optional<std::filesystem::path>& out,
                                                  const HostContext& context);

  /// As the file has it, or had it when it was last saved.
  [[nodiscard]] const std::shared_ptr<const KinematicTree>& robot() const noexcept {
    return robot_;
  }
  /// Where spheres are saved.
  [[nodiscard]] const std::filesystem::path& target() const noexcept { return target_; }
  /// Of the text that was read last: another one where the file was changed since.
  [[nodiscard]] std::string revision() const;

  /// Fails with kIo where save() could not write.
  [[nodiscard]] Result<void> check_writable() const;

  /// Replaces the spheres and nothing else; the file is replaced at once, or left as it was. Fails
  /// with kInvalidArgument for spheres that are none, with kIo where the file cannot be written,
  /// or was changed meanwhile, and with kConfig where the new file would not say what it should.
  [[nodiscard]] Result<void> save(const std::vector<CollisionSphere>& spheres);

 private:
  SphereProfile(std::filesystem::path source, std::filesystem::path target,
                const HostContext& context)
      : source_(std::move(source)), target_(std::move(target)), context_(&context) {}
  [[nodiscard]] Result<void> read();
  [[nodiscard]] Result<std::string> text_with(const std::vector<CollisionSphere>& spheres) const;
  [[nodiscard]] Result<void> replace_target(const std::string& text,
                                            const std::vector<CollisionSphere>& spheres);

  std::filesystem::path source_;  ///< What is read: the profile, then what was saved.
  std::filesystem::path target_;
  const HostContext* context_;
  std::string text_;
  std::shared_ptr<const KinematicTree> robot_;
};

/// A sphere as an item of a profile's list: `- {link: ..., centre_m: [...], radius_m: ...}`.
[[nodiscard]] std::string sphere_item(const CollisionSphere& sphere,
                                      const std::vector<Link>& links);

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
