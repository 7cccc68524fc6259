#include "bag_writing.hpp"
#include "conformance/gaze_conformance.hpp"
#include "conformance/source_conformance.hpp"

namespace sidestep::conformance {
namespace {

namespace bags = rosbag::testing;

/// Ten images, 10 a second, of a camera that moves on a robot; tf lacks from 0.45 s to 0.65 s.
void write_bag_of_robot(const std::filesystem::path& file) {
  bags::BagWriter bag(file);
  const auto begin = bags::after_s(0.0);
  bag.write("/camera/depth/camera_info", begin,
            ros_messages::to_camera_info(bags::kCamera, begin, "camera"));
  const auto joints = robot_with_head()->description().joints;
  for (int i = 0; i <= 20; ++i) {
    const double time_s = 0.05 * i;
    const Stamp stamp = bags::after_s(time_s);
    bag.write("/joint_states", stamp,
              ros_messages::to_joint_state(joints, std::vector{0.3 * time_s, 0.1}, stamp));
    if (time_s > 0.45 && time_s < 0.65) continue;
    const Transform T_map_camera =
        transform_from_xyz_rpy({0.3 * time_s, 0.1, 1.0}, {-0.5, 0.1, 1.0 * time_s});
    bag.write("/tf", stamp, bags::tf_message(T_map_camera, stamp, "map", "camera"));
  }
  for (int i = 0; i < 10; ++i) {
    const Stamp stamp = bags::after_s(0.1 * i + 0.02);
    bag.write("/camera/depth/image", stamp, bags::flat_image(1000 + i, stamp));
  }
}

SourceCase bag(const std::string& name,
               const std::function<void(const std::filesystem::path&)>& write,
               const std::function<void(rosbag::Options&)>& change, bool is_live = false) {
  struct Parts {
    explicit Parts(const Clock& clock) : host(1, {.robot = robot_with_head(), .clock = &clock}) {}
    testing_support::TemporaryFolder folder;
    TestHost host;
    std::unique_ptr<Source> source;
  };
  const auto make = [=](const Clock& clock) {
    auto parts = std::make_shared<Parts>(clock);
    const std::filesystem::path file = parts->folder.path() / "test.bag";
    write(file);
    rosbag::Options options = bags::options_of(file);
    change(options);
    auto source = rosbag::create_source(options, parts->host.context());
    if (!source) throw std::runtime_error(source.error().describe());
    parts->source = std::move(*source);
    return std::shared_ptr<Source>(parts, parts->source.get());
  };
  return {name, make, is_live};
}

void flat(const std::filesystem::path& file) { bags::write_flat_bag(file, 10, {}); }

INSTANTIATE_TEST_SUITE_P(
    Rosbag, SourceConformance,
    testing::Values(bag("images", flat, [](auto&) {}),
                    bag(
                        "at_the_runs_pace", flat, [](auto& o) { o.pace = "clock"; }, true),
                    bag("on_a_robot", write_bag_of_robot, [](auto& o) { o.joints.emplace(); })),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
