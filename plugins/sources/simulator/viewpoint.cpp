#include "viewpoint.hpp"

namespace sidestep::simulator {

Result<Viewpoint> Viewpoint::create(const Options& options, const HostContext& context) {
  if (!options.mount) {
    return Viewpoint(CameraPath(options.camera_path, options.camera_path_repeats));
  }
  auto mounted = SIDESTEP_TRY(MountedCamera::create(*options.mount, context));
  return Viewpoint(std::move(mounted));
}

std::vector<SceneObject> Viewpoint::shapes() const {
  const auto* mounted = std::get_if<MountedCamera>(&on_);
  return mounted != nullptr ? mounted->shapes() : std::vector<SceneObject>{};
}

std::optional<View> Viewpoint::view(Stamp stamp) {
  if (auto* mounted = std::get_if<MountedCamera>(&on_)) return mounted->view(stamp);
  const Transform pose = std::get<CameraPath>(on_).T_world_camera(stamp.seconds());
  return View{pose, pose, {}, {}};
}

Stamp Viewpoint::known_until() const {
  const auto* mounted = std::get_if<MountedCamera>(&on_);
  if (mounted == nullptr) return {std::numeric_limits<std::int64_t>::max()};
  return mounted->newest().value_or(Stamp{std::numeric_limits<std::int64_t>::min()});
}

std::vector<OptionMistake> check_mount(const MountOptions& mount) {
  std::vector<OptionMistake> mistakes;
  const HeadOptions& head = mount.head;
  if (head.pan_lower_rad > head.pan_upper_rad) {
    mistakes.push_back({{"mount.head.pan_lower_rad", "mount.head.pan_upper_rad"},
                        "must not be above pan_upper_rad",
                        {}});
  }
  if (head.tilt_lower_rad > head.tilt_upper_rad) {
    mistakes.push_back({{"mount.head.tilt_lower_rad", "mount.head.tilt_upper_rad"},
                        "must not be above tilt_upper_rad",
                        {}});
  }
  return mistakes;
}

}  // namespace sidestep::simulator
