#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/host.hpp>

#include "simulator_testing.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

/// The library as the host loads it, from its parameters as text.
class SimulatorPlugin : public ::testing::Test {
 protected:
  static Node block(const std::string& text) {
    std::vector<Error> errors;
    auto node = parse_yaml(text, "run.yaml", errors);
    EXPECT_TRUE(node && errors.empty());
    return node ? *node : Node();
  }

  conformance::TestHost parts_{2, simulator::testing::host_parts()};
  HostContext context_ = parts_.context();
  Host host_{{{SIDESTEP_PLUGIN_FOLDER}, {}, {simulator::testing::scenes()}, 7},
             context_.log,
             context_.clock,
             context_.workers,
             context_.documents};
};

TEST_F(SimulatorPlugin, HandsOutFramesAndTheirGroundTruthAcrossTheBoundary) {
  const Node node = block(
      "{plugin: simulator, frames: 1, camera: {width_px: 40, height_px: 30, fx_px: 35, fy_px: 35,"
      " cx_px: 19.5, cy_px: 14.5}, noise: {model: kinect},"
      " camera_path: [{time_s: 0, position_m: [-0.6, -2.2, 1.2], look_at_m: [0.9, 0.2, 0.7]}]}");
  std::vector<Error> errors;
  host_.check(PluginKind::kSource, node, errors);
  EXPECT_TRUE(errors.empty()) << errors.front().describe();
  auto source = host_.create<Source>(node);
  ASSERT_TRUE(source) << source.error().describe();
  const auto* truth = dynamic_cast<const GroundTruth*>(source->get());
  ASSERT_NE(truth, nullptr);
  EXPECT_GT(truth->scene().objects().size(), 10U);
  const auto frame = (*source)->next(Deadline());
  ASSERT_TRUE(frame) << frame.error().describe();
  EXPECT_EQ(std::get<DepthImage>((*frame)->measurement).depth_m.size(), 40U * 30U);
}

TEST_F(SimulatorPlugin, ChecksItsParametersAtEveryDepth) {
  const Node node = block(
      "{plugin: simulator, frames: -1, noise: {modell: kinect, random_dropout: 2},"
      " camera_path: [{time_s: .nan, position_m: [0, 0]}]}");
  std::vector<Error> errors;
  host_.check(PluginKind::kSource, node, errors);
  std::string all;
  for (const Error& error : errors) all += error.describe() + "\n";
  EXPECT_EQ(errors.size(), 5U) << all;
  EXPECT_THAT(all, HasSubstr("frames"));
  EXPECT_THAT(all, HasSubstr("did you mean 'model'"));
  EXPECT_THAT(all, HasSubstr("random_dropout"));
  EXPECT_THAT(all, HasSubstr("position_m"));
}

}  // namespace
}  // namespace sidestep
