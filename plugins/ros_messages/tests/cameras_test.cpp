#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

constexpr CameraIntrinsics kXtion{640, 480, 554.25, 553.5, 319.5, 241.25};

CameraInfo info_of(const CameraIntrinsics& camera) {
  return to_camera_info(camera, Stamp{1}, "camera");
}

void expect_same(const CameraIntrinsics& a, const CameraIntrinsics& b) {
  EXPECT_EQ(a.width_px, b.width_px);
  EXPECT_EQ(a.height_px, b.height_px);
  EXPECT_EQ(a.fx_px, b.fx_px);
  EXPECT_EQ(a.fy_px, b.fy_px);
  EXPECT_EQ(a.cx_px, b.cx_px);
  EXPECT_EQ(a.cy_px, b.cy_px);
}

TEST(CameraInfo, ComesBackAsItWasWritten) {
  const auto read = intrinsics(info_of(kXtion));
  ASSERT_TRUE(read) << read.error().describe();
  expect_same(*read, kXtion);
}

TEST(CameraInfo, OfRectifiedImagesIsTheProjectionMatrix) {
  CameraInfo info = info_of(kXtion);
  info.K[0] = info.K[4] = 100.0;  // of the raw image
  expect_same(intrinsics(info).value(), kXtion);
}

TEST(CameraInfo, WithoutProjectionMatrixIsTheCameraMatrix) {
  CameraInfo info = info_of(kXtion);
  info.P.assign(0.0);
  expect_same(intrinsics(info).value(), kXtion);
  EXPECT_FALSE(is_distorted(info));
  info.D[1] = 0.1;
  EXPECT_TRUE(is_distorted(info));
  EXPECT_FALSE(is_distorted(info_of(kXtion)));
}

/// A pixel of the part sees what the pixel that it was made of sees.
TEST(CameraInfo, OfARegionThatIsBinnedSeesTheSameRays) {
  CameraInfo info = info_of(kXtion);
  info.roi.x_offset = 100;
  info.roi.y_offset = 40;
  info.roi.width = 400;
  info.roi.height = 300;
  info.binning_x = 2;
  info.binning_y = 3;
  const auto part = intrinsics(info);
  ASSERT_TRUE(part) << part.error().describe();
  EXPECT_EQ(part->width_px, 200);
  EXPECT_EQ(part->height_px, 100);
  const Eigen::Vector3d seen = part->unproject(17.0, 29.0, 2.0);
  const Eigen::Vector3d expected = kXtion.unproject(100.0 + 2 * 17.0, 40.0 + 3 * 29.0, 2.0);
  EXPECT_LT((seen - expected).norm(), 1e-12);
}

TEST(CameraInfo, ThatIsNoneIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<CameraInfo> bad(5, info_of(kXtion));
  bad[0].width = 0;
  bad[1].height = 4'000'000'000U;
  bad[2].P[5] = -1.0;
  bad[3].P[2] = nan;
  bad[4].P.assign(0.0);
  bad[4].K.assign(0.0);
  for (const CameraInfo& info : bad) {
    const auto read = intrinsics(info);
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().code, ErrorCode::kBadFrame);
  }
}

}  // namespace
}  // namespace sidestep::ros_messages
