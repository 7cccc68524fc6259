#include <sidestep/mapping/frame_check.hpp>

#include <cmath>
#include <string>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

Frame good_frame() {
  Frame frame;
  frame.sequence = 42;
  frame.measurement = DepthImage{{4, 3, 5.0, 5.0, 1.5, 1.0}, std::vector<float>(12, 1.0F)};
  return frame;
}

DepthImage& image_of(Frame& frame) { return std::get<DepthImage>(frame.measurement); }

void expect_bad(const Frame& frame, const std::string& what) {
  const auto checked = check_frame(frame);
  ASSERT_FALSE(checked) << what;
  EXPECT_EQ(checked.error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(checked.error().where, "frame 42");
  EXPECT_NE(checked.error().message.find(what), std::string::npos) << checked.error().message;
}

TEST(FrameCheck, AcceptsGoodFramesWhateverTheirPixels) {
  Frame frame = good_frame();
  EXPECT_TRUE(check_frame(frame));
  image_of(frame).depth_m = std::vector<float>(12, std::nanf(""));
  EXPECT_TRUE(check_frame(frame));
  frame.measurement = PointCloud{};
  EXPECT_TRUE(check_frame(frame));
}

TEST(FrameCheck, RefusesImagesThatDoNotFitTheirCamera) {
  Frame frame = good_frame();
  image_of(frame).depth_m.pop_back();
  expect_bad(frame, "11 depths for a camera of 4 x 3 pixels");
  frame = good_frame();
  image_of(frame).camera.width_px = 0;
  expect_bad(frame, "0 x 3 pixels");
  frame = good_frame();
  image_of(frame).camera.height_px = -3;
  expect_bad(frame, "4 x -3 pixels");
  frame = good_frame();
  image_of(frame).camera.fy_px = 0.0;
  expect_bad(frame, "focal length is 0.0");
  frame = good_frame();
  image_of(frame).camera.fx_px = std::nan("");
  expect_bad(frame, "focal length is nan");
  frame = good_frame();
  image_of(frame).camera.cx_px = HUGE_VAL;
  expect_bad(frame, "principal point");
}

TEST(FrameCheck, RefusesSizesWhoseProductOverflowsAnInt) {
  Frame frame = good_frame();
  image_of(frame).camera.width_px = 1 << 17;
  image_of(frame).camera.height_px = 1 << 17;
  expect_bad(frame, "12 depths for a camera of 131072 x 131072 pixels");
}

TEST(FrameCheck, RefusesPosesThatAreNotRigid) {
  Frame frame = good_frame();
  frame.T_world_camera.translation().z() = std::nan("");
  expect_bad(frame, "not finite");
  frame = good_frame();
  frame.T_world_camera.linear() *= 1.01;
  expect_bad(frame, "not orthonormal");
  frame = good_frame();
  frame.T_world_camera.linear() = Eigen::Vector3d(1, 1, -1).asDiagonal();
  expect_bad(frame, "mirrors");
  frame = good_frame();
  frame.T_world_camera.linear().setZero();
  expect_bad(frame, "not orthonormal");
}

TEST(FrameCheck, AcceptsPosesRoundedToFloat) {
  Frame frame = good_frame();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.234, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  frame.T_world_camera.linear() = turn.cast<float>().cast<double>();
  EXPECT_TRUE(check_frame(frame));
}

}  // namespace
}  // namespace sidestep
