#include "conformance/source_conformance.hpp"
#include "hsr_on_its_way.hpp"

namespace sidestep::conformance {
namespace {

/// Small images, 10 a second, of a camera that pans over the room.
simulator::Options small_options() {
  simulator::Options options = simulator::testing::room_options();
  options.camera = {40, 30, 34.6, 34.6, 19.5, 14.5};
  options.frames = 6;
  options.rate_hz = 10.0;
  return options;
}

SourceCase on_a_path(const std::string& name,
                     const std::function<void(simulator::Options&)>& change) {
  simulator::Options options = small_options();
  change(options);
  struct Parts {
    explicit Parts(const Clock& clock) : host(2, parts_of(clock)) {}
    static TestHostParts parts_of(const Clock& clock) {
      TestHostParts parts = simulator::testing::host_parts();
      parts.clock = &clock;
      return parts;
    }
    TestHost host;
    std::unique_ptr<Source> source;
  };
  const auto make = [options](const Clock& clock) {
    auto parts = std::make_shared<Parts>(clock);
    auto source = simulator::create_source(options, parts->host.context(5));
    if (!source) throw std::runtime_error(source.error().describe());
    parts->source = std::move(*source);
    return std::shared_ptr<Source>(parts, parts->source.get());
  };
  // Disparities of so coarse an image are some 0.1 m apart.
  const double truth_error_m = options.noise.model == "kinect" ? 0.1 : 1e-4;
  return {name, make, options.pace == "clock", truth_error_m};
}

/// On the HSR, whose states are known from its second frame on.
SourceCase on_a_robot(const std::string& name,
                      const std::function<void(simulator::Options&)>& change) {
  simulator::Options options = small_options();
  options.camera_path.clear();
  options.mount = simulator::MountOptions{.link = "head_rgbd_sensor_link"};
  change(options);
  struct Parts {
    simulator::testing::HsrOnItsWay hsr;
    std::unique_ptr<Source> source;
  };
  return {name, [options](const Clock&) {
            auto parts = std::make_shared<Parts>();
            Eigen::VectorXd qdot = Eigen::VectorXd::Zero(parts->hsr.description().dof());
            qdot[0] = 0.1;
            parts->hsr.move(parts->hsr.pose("go"), qdot, 0.05, 1.0);
            auto source = simulator::create_source(options, parts->hsr.context());
            if (!source) throw std::runtime_error(source.error().describe());
            parts->source = std::move(*source);
            return std::shared_ptr<Source>(parts, parts->source.get());
          }};
}

void kinect(simulator::Options& options) { options.noise.model = "kinect"; }
void for_ever(simulator::Options& options) { options.frames = 0; }
void at_the_runs_pace(simulator::Options& options) { options.pace = "clock"; }
void with_people(simulator::Options& options) {
  options.scene = "hall_03";
  options.frames = 10;
}
void in_turn(simulator::Options& options) {
  options.camera_path.clear();
  options.fixed_cameras = {{{-0.6, -2.2, 1.2}, {0.9, 0.2, 0.7}}, {{-0.6, 1.0, 1.2}, {-2, 0, 0.4}}};
}
void laser(simulator::Options& options) {
  options.mount = simulator::MountOptions{.link = "base_range_sensor_link"};
  options.laser = simulator::LaserOptions{.beams = 90};
}

INSTANTIATE_TEST_SUITE_P(
    Simulator, SourceConformance,
    testing::Values(on_a_path("exact", [](auto&) {}), on_a_path("kinect", kinect),
                    on_a_path("for_ever", for_ever),
                    on_a_path("at_the_runs_pace", at_the_runs_pace),
                    on_a_path("among_people", with_people), on_a_path("fixed_cameras", in_turn),
                    on_a_robot("on_a_robot", [](auto&) {}), on_a_robot("laser", laser)),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
