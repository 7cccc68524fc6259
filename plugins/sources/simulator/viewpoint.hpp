#pragma once

#include <limits>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "camera_path.hpp"
#include "mounted_camera.hpp"

namespace sidestep::simulator {

/// Where a camera is: on its path, or on the robot.
class Viewpoint {
 public:
  /// Fails as MountedCamera::create() does.
  [[nodiscard]] static Result<Viewpoint> create(const Options& options, const HostContext& context);

  /// The robot's shapes that it may see.
  [[nodiscard]] std::vector<SceneObject> shapes() const;
  /// The view at a time; nothing where it is not known. Times go forward.
  [[nodiscard]] std::optional<View> view(Stamp stamp);
  /// The newest time at which the view may be known; before all time where it never was.
  [[nodiscard]] Stamp known_until() const;
  /// Whether a view that is not known now never will be.
  [[nodiscard]] bool is_past(Stamp stamp) const { return known_until() >= stamp; }

 private:
  explicit Viewpoint(std::variant<CameraPath, MountedCamera> on) : on_(std::move(on)) {}

  std::variant<CameraPath, MountedCamera> on_;
};

/// What is wrong with the parameter `mount` in itself.
[[nodiscard]] std::vector<OptionMistake> check_mount(const MountOptions& mount);

}  // namespace sidestep::simulator
