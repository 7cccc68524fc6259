#pragma once

#include <nlohmann/json_fwd.hpp>

#include "rigid_body.hpp"
#include "sphere_cover.hpp"
#include "sphere_profile.hpp"
#include "view_message.hpp"

namespace sidestep {

/// Answers the sphere editor's page (docs/reference/sphere_editor.md): measures, fits and saves the
/// spheres that it is sent. Pages can reach the profile's own file alone, and no path is theirs to
/// name. [any one thread]
class SphereDesk final : public PageRequestHandler {
 public:
  /// The profile outlives the desk.
  explicit SphereDesk(SphereProfile& profile);

  [[nodiscard]] std::vector<ViewMessage> greeting() override;
  [[nodiscard]] std::optional<ViewMessage> answer(std::string_view request,
                                                  const std::stop_token& stop) override;

 private:
  SphereProfile& profile_;
  std::vector<RigidBody> bodies_;
};

/// As the page is told of it, and `sidestep robot --json` tells.
[[nodiscard]] nlohmann::ordered_json cover_json(const RobotCover& cover);

}  // namespace sidestep
