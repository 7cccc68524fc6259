#include <bit>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

using ::testing::HasSubstr;

struct CloudLayout {
  const char* name;
  std::uint32_t width = 5;
  std::uint32_t height = 2;
  std::uint32_t point_step = 12;
  std::array<std::uint32_t, 3> offsets{0, 4, 8};
  bool is_double = false;
  bool is_big = false;
  std::uint32_t row_padding = 0;

  friend void PrintTo(const CloudLayout& layout, std::ostream* out) { *out << layout.name; }
};

/// Writes a number at a place byte by byte.
void put_at(std::uint64_t raw, int bytes, bool is_big, std::uint8_t* at) {
  for (int i = 0; i < bytes; ++i) {
    at[i] = static_cast<std::uint8_t>(raw >> (8 * (is_big ? bytes - 1 - i : i)));
  }
}

PointCloud2 cloud_of(const std::vector<Eigen::Vector3f>& points, const CloudLayout& layout) {
  PointCloud2 message;
  message.width = layout.width;
  message.height = layout.height;
  message.point_step = layout.point_step;
  message.row_step = layout.width * layout.point_step + layout.row_padding;
  message.is_bigendian = layout.is_big ? 1 : 0;
  message.data.assign(static_cast<std::size_t>(message.row_step) * layout.height, 0xab);
  const char* const names[] = {"rgb", "z", "x", "y"};  // in any order, with others
  const int axes[] = {-1, 2, 0, 1};
  for (std::size_t f = 0; f < 4; ++f) {
    PointField field;
    field.name = names[f];
    field.count = 1;
    field.datatype = layout.is_double && axes[f] >= 0 ? PointField::FLOAT64 : PointField::FLOAT32;
    field.offset = axes[f] >= 0 ? layout.offsets[static_cast<std::size_t>(axes[f])] : 0;
    message.fields.push_back(field);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint8_t* const point = message.data.data() + i / layout.width * message.row_step +
                                i % layout.width * layout.point_step;
    for (int axis = 0; axis < 3; ++axis) {
      const float value = points[i][axis];
      std::uint8_t* const at = point + layout.offsets[static_cast<std::size_t>(axis)];
      if (layout.is_double) {
        put_at(std::bit_cast<std::uint64_t>(static_cast<double>(value)), 8, layout.is_big, at);
      } else {
        put_at(std::bit_cast<std::uint32_t>(value), 4, layout.is_big, at);
      }
    }
  }
  return message;
}

std::vector<Eigen::Vector3f> some_points() {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 10; ++i) {
    const auto k = static_cast<float>(i);
    points.emplace_back(0.1F * k, -0.3F + k, 1.0F / (1.0F + k));
  }
  return points;
}

class EveryCloud : public ::testing::TestWithParam<CloudLayout> {};

TEST_P(EveryCloud, IsReadPointByPoint) {
  const auto cloud = point_cloud(cloud_of(some_points(), GetParam()));
  ASSERT_TRUE(cloud) << cloud.error().describe();
  EXPECT_EQ(cloud->points_m, some_points());
}

INSTANTIATE_TEST_SUITE_P(
    Clouds, EveryCloud,
    ::testing::Values(
        CloudLayout{.name = "tight"}, CloudLayout{.name = "unorganised", .width = 10, .height = 1},
        CloudLayout{.name = "pcl", .point_step = 32, .row_padding = 0},
        CloudLayout{.name = "odd", .point_step = 23, .offsets = {11, 1, 19}},
        CloudLayout{.name = "padded_rows", .point_step = 16, .row_padding = 5},
        CloudLayout{.name = "big_endian", .point_step = 16, .is_big = true},
        CloudLayout{.name = "doubles", .point_step = 24, .offsets = {0, 8, 16}, .is_double = true},
        CloudLayout{.name = "big_endian_doubles",
                    .point_step = 40,
                    .offsets = {3, 30, 16},
                    .is_double = true,
                    .is_big = true}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST(Clouds, LoseThePointsThatAreNotFinite) {
  auto points = some_points();
  points[2].y() = std::numeric_limits<float>::quiet_NaN();
  points[7].x() = std::numeric_limits<float>::infinity();
  const auto cloud = point_cloud(cloud_of(points, {.name = ""}));
  ASSERT_TRUE(cloud) << cloud.error().describe();
  points.erase(points.begin() + 7);
  points.erase(points.begin() + 2);
  EXPECT_EQ(cloud->points_m, points);
}

TEST(Clouds, MayBeEmptyOrSayToBeHuge) {
  PointCloud2 message = cloud_of({}, {.name = "", .width = 0, .height = 1});
  EXPECT_TRUE(point_cloud(message)->points_m.empty());
  message.height = 0xffffffffU;  // of rows without points
  EXPECT_TRUE(point_cloud(message)->points_m.empty());
  message.width = 0xffffffffU;
  message.row_step = 0xffffffffU;
  EXPECT_FALSE(point_cloud(message));
  message.height = 0;
  EXPECT_TRUE(point_cloud(message)->points_m.empty());
}

TEST(Clouds, SayWhatIsWrongWithThem) {
  const PointCloud2 good = cloud_of(some_points(), {.name = ""});
  std::vector<std::pair<PointCloud2, std::string>> bad(6, {good, ""});
  bad[0].first.fields[1].name = "depth";
  bad[0].second = "no field z";
  bad[1].first.fields[2].datatype = PointField::INT32;
  bad[1].second = "field x is no floating-point number";
  bad[2].first.fields[3].offset = 9;
  bad[2].second = "field y lies beyond";
  bad[3].first.data.pop_back();
  bad[3].second = "119 bytes";
  bad[4].first.row_step = 59;
  bad[4].second = "59 bytes";
  bad[5].first.fields[3].offset = 0xffffffffU;
  bad[5].second = "field y lies beyond";
  for (const auto& [message, expected] : bad) {
    const auto cloud = point_cloud(message);
    ASSERT_FALSE(cloud) << expected;
    EXPECT_EQ(cloud.error().code, ErrorCode::kBadFrame);
    EXPECT_THAT(cloud.error().message, HasSubstr(expected));
  }
}

TEST(Clouds, ComeBackAsTheyWereWritten) {
  const PointCloud cloud{some_points()};
  const PointCloud2 message = to_point_cloud(cloud, Stamp{7}, "lidar");
  EXPECT_EQ(message.header.frame_id, "lidar");
  EXPECT_EQ(point_cloud(message)->points_m, cloud.points_m);
  EXPECT_TRUE(point_cloud(to_point_cloud({}, Stamp{}, ""))->points_m.empty());
}

/// Beams at -90, 0 and 90 degrees, and what is no measurement.
TEST(LaserScans, ArePointsInThePlaneOfTheLaser) {
  LaserScan message;
  message.angle_min = -1.5707964F;
  message.angle_increment = 1.5707964F;
  message.range_min = 0.1F;
  message.range_max = 10.0F;
  message.ranges = {2.0F, 3.0F, 4.0F};
  const auto scan = laser_scan(message);
  ASSERT_TRUE(scan);
  ASSERT_EQ(scan->points_m.size(), 3U);
  EXPECT_LT((scan->points_m[0] - Eigen::Vector3f(0, -2, 0)).norm(), 1e-6F);
  EXPECT_LT((scan->points_m[1] - Eigen::Vector3f(3, 0, 0)).norm(), 1e-6F);
  EXPECT_LT((scan->points_m[2] - Eigen::Vector3f(0, 4, 0)).norm(), 1e-6F);
  constexpr float kInf = std::numeric_limits<float>::infinity();
  message.ranges = {0.05F, 10.5F, kInf, -kInf, std::nanf(""), 0.0F, -1.0F};
  const auto unmeasured = laser_scan(message);
  ASSERT_TRUE(unmeasured);
  EXPECT_EQ(unmeasured->points_m.size(), 7U);
  for (const Eigen::Vector3f& p : unmeasured->points_m) EXPECT_TRUE(p.hasNaN());
  message.angle_increment = std::nanf("");
  ASSERT_FALSE(laser_scan(message));
  EXPECT_EQ(laser_scan(message).error().code, ErrorCode::kBadFrame);
}

TEST(LaserScans, AreWrittenAsTheyAreRead) {
  PointCloud scan;
  for (const float range_m : {1.0F, 2.5F, 3.0F}) {
    const auto angle_rad = 0.3F * (static_cast<float>(scan.points_m.size()) - 1.0F);
    scan.points_m.emplace_back(range_m * std::cos(angle_rad), range_m * std::sin(angle_rad), 0.0F);
  }
  scan.points_m.insert(scan.points_m.begin() + 1, Eigen::Vector3f::Constant(std::nanf("")));
  scan.points_m.pop_back();
  const auto read = laser_scan(to_laser_scan(scan, -0.3, 0.3, {0.1, 5.0}, Stamp{7}, "laser"));
  ASSERT_TRUE(read);
  ASSERT_EQ(read->points_m.size(), 3U);
  EXPECT_LT((read->points_m[0] - scan.points_m[0]).norm(), 1e-6F);
  EXPECT_TRUE(read->points_m[1].hasNaN());
  EXPECT_NEAR(read->points_m[2].norm(), 2.5F, 1e-6F);
}

}  // namespace
}  // namespace sidestep::ros_messages
