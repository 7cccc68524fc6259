#include "pcd_file.hpp"

#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pcd_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::pcd {
namespace {

using testing::ascii_pcd;
using testing::binary_pcd;
using testing::bytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::header;
using testing::Points;

const Points kThree = {{1.5F, -2.25F, 3.0F}, {0.0F, 0.125F, -7.5F}, {1e-3F, 1e3F, 42.0F}};

class PcdFile : public ::testing::Test {
 protected:
  Result<PcdCloud> read(const std::string& content) {
    return read_pcd(folder_.write("cloud.pcd", content));
  }
  /// The error's text, less the folder.
  std::string complaint(const std::string& content) {
    const auto cloud = read(content);
    if (cloud) return "no error";
    EXPECT_EQ(cloud.error().code, ErrorCode::kBadFrame);
    std::string text = cloud.error().describe();
    const std::string folder = folder_.path().string() + "/";
    if (text.starts_with(folder)) text.erase(0, folder.size());
    return text;
  }
  testing_support::TemporaryFolder folder_;
};

TEST_F(PcdFile, ReadsAsciiAndBinary) {
  for (const std::string& content : {ascii_pcd(kThree), binary_pcd(kThree)}) {
    const auto cloud = read(content);
    ASSERT_TRUE(cloud) << cloud.error().describe();
    EXPECT_EQ(cloud->points_m, kThree);
    ASSERT_TRUE(cloud->T_world_sensor);
    EXPECT_TRUE(cloud->T_world_sensor->isApprox(Transform::Identity()));
  }
}

// PCL's own writer decides what is right: 500 random points, in each of its formats.
TEST_F(PcdFile, ReadsWhatPclWrites) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> at(-5.0F, 5.0F);
  Points points;
  for (int i = 0; i < 500; ++i) points.emplace_back(at(random), at(random), 0.25F * (i % 4));
  const float half = std::sqrt(0.5F);
  for (const auto format : {testing::PclFormat::kAscii, testing::PclFormat::kBinary,
                            testing::PclFormat::kBinaryCompressed}) {
    const auto file = folder_.path() / "pcl.pcd";
    testing::write_with_pcl(file, points, format, {1, 2, 3, 0}, {half, 0, 0, half});
    const auto cloud = read_pcd(file);
    ASSERT_TRUE(cloud) << cloud.error().describe();
    ASSERT_EQ(cloud->points_m.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      // Nine digits give a float back exactly.
      ASSERT_EQ(cloud->points_m[i], points[i]) << i;
    }
    ASSERT_TRUE(cloud->T_world_sensor);
    // A quarter turn about z, and the sensor at (1, 2, 3).
    EXPECT_TRUE((*cloud->T_world_sensor * Eigen::Vector3d(1, 0, 0))
                    .isApprox(Eigen::Vector3d(1, 3, 3), 1e-5));
  }
}

TEST_F(PcdFile, FindsTheCoordinatesAmongOtherFieldsAndInDoubles) {
  const std::string head =
      "FIELDS label z x normal y\nSIZE 2 8 4 4 4\nTYPE U F F F F\nCOUNT 1 1 1 3 1\nWIDTH 1\n"
      "HEIGHT 1\nPOINTS 1\nDATA ";
  auto cloud = read(head + "ascii\n7 3.5 1.5 0 0 1 2.5\n");
  ASSERT_TRUE(cloud) << cloud.error().describe();
  EXPECT_THAT(cloud->points_m, ElementsAre(Eigen::Vector3f(1.5F, 2.5F, 3.5F)));
  EXPECT_FALSE(cloud->T_world_sensor) << "no VIEWPOINT";
  const std::string point = bytes(std::uint16_t{7}) + bytes(3.5) + bytes(1.5F) + bytes(0.0F) +
                            bytes(0.0F) + bytes(1.0F) + bytes(2.5F);
  cloud = read(head + "binary\n" + point);
  ASSERT_TRUE(cloud) << cloud.error().describe();
  EXPECT_THAT(cloud->points_m, ElementsAre(Eigen::Vector3f(1.5F, 2.5F, 3.5F)));
}

TEST_F(PcdFile, DropsPointsThatAreNotFinite) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const auto ascii = read(header(4, "ascii") + "1 2 3\nnan nan nan\n4 -1e999 6\r\n7 8 9\n");
  ASSERT_TRUE(ascii) << ascii.error().describe();
  EXPECT_THAT(ascii->points_m, ElementsAre(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(7, 8, 9)));
  const auto binary = read(binary_pcd({{1, 2, 3}, {nan, 0, 0}, {0, 0, infinity}}));
  ASSERT_TRUE(binary);
  EXPECT_THAT(binary->points_m, ElementsAre(Eigen::Vector3f(1, 2, 3)));
}

TEST_F(PcdFile, UnpacksCompressedPoints) {
  // All x, then all y, then all z; the second and third zero repeat the first four bytes.
  const std::string one = bytes(1.0F);
  std::string packed = std::string(1, '\x03') + one;  // 4 bytes as they are
  packed += std::string("\xe0\x0b\x03", 3);           // 11 + 7 + 2 = 20 bytes from 4 back
  const auto cloud =
      read(header(2, "binary_compressed") + bytes(static_cast<std::uint32_t>(packed.size())) +
           bytes(std::uint32_t{24}) + packed);
  ASSERT_TRUE(cloud) << cloud.error().describe();
  EXPECT_THAT(cloud->points_m, ElementsAre(Eigen::Vector3f(1, 1, 1), Eigen::Vector3f(1, 1, 1)));
}

TEST(Lzf, RefusesDamagedDataWithoutReadingBeyondIt) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::uint8_t> packed(static_cast<std::size_t>(byte(random) % 24));
    for (auto& b : packed) b = static_cast<std::uint8_t>(byte(random));
    const auto size = static_cast<std::size_t>(byte(random));
    const auto out = unpack_lzf(packed, size);
    ASSERT_TRUE(!out || out->size() == size);
  }
  EXPECT_FALSE(unpack_lzf({}, std::size_t{1} << 40)) << "a size made up";
}

TEST_F(PcdFile, SaysWhatIsWrongAndWhere) {
  const std::string ascii = ascii_pcd(kThree);
  const std::string binary = binary_pcd(kThree);
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "cloud.pcd: the file is empty"},
      {"FIELDS x y z\nSIZE 4 4 4\n",
       "cloud.pcd:2: the header has no line DATA; the file is cut off, or no point cloud"},
      {"\x89PNG\r\n\x1a\n", "cloud.pcd:1: '\x89PNG' is no line of a PCD header"},
      {ascii.substr(0, ascii.rfind("0.00")),
       "cloud.pcd: the file is cut off: it holds 2 of 3 points"},
      {binary.substr(0, binary.size() - 1),
       "cloud.pcd: the file is cut off: it holds 35 of 36 bytes of points"},
      {header(3, "binary_compressed") + "abc",
       "cloud.pcd: the file is cut off: it holds 3 of 8 bytes of points"},
      {header(3, "binary_compressed") + bytes(std::uint32_t{9}) + bytes(std::uint32_t{36}) + "abc",
       "cloud.pcd: the file is cut off: it holds 3 of 9 bytes of points"},
      {header(3, "binary_compressed") + bytes(std::uint32_t{3}) + bytes(std::uint32_t{35}) + "abc",
       "cloud.pcd: the compressed points unpack to 35 bytes, the header names points of 36"},
      {header(3, "binary_compressed") + bytes(std::uint32_t{3}) + bytes(std::uint32_t{36}) + "abc",
       "cloud.pcd: the compressed points are damaged"},
      {header(1, "ascii", "x y intensity") + "1 2 3\n",
       "cloud.pcd: there is no field z among the fields x y intensity"},
      {replaced(ascii, "TYPE F F F", "TYPE F U F"),
       "cloud.pcd: the field y is of type U, size 4 and count 1, expected F, 4 or 8, and 1"},
      {replaced(ascii, "SIZE 4 4 4", "SIZE 4 4"), "cloud.pcd:4: SIZE has 2 values, FIELDS has 3"},
      {replaced(ascii, "SIZE 4 4 4", "SIZE 4 x 4"), "cloud.pcd:4: SIZE of the field y is 'x'"},
      {replaced(ascii, "TYPE F F F", "TYPE F F G"),
       "cloud.pcd:5: TYPE of the field z is 'G', expected I, U or F"},
      {replaced(ascii, "POINTS 3", "POINTS 4"),
       "cloud.pcd:11: POINTS is 4, WIDTH times HEIGHT is 3"},
      {replaced(ascii, "POINTS 3", "POINTS -3"), "cloud.pcd:10: POINTS is not one whole number"},
      {replaced(ascii, "DATA ascii", "DATA zip"),
       "cloud.pcd:11: DATA is 'zip', expected ascii, binary or binary_compressed"},
      {replaced(ascii, "0 0 0 1 0 0 0", "0 0 nan 1 0 0 0"),
       "cloud.pcd:9: VIEWPOINT is not seven finite numbers, tx ty tz qw qx qy qz"},
      {replaced(ascii, "0 0 0 1 0 0 0", "0 0 0 2 0 0 0"),
       "cloud.pcd:9: the quaternion of VIEWPOINT, qw qx qy qz, has the length 2.000000, "
       "expected 1"},
      {header(2, "ascii") + "1 2 3\n4 five 6\n", "cloud.pcd:13: expected a number, found 'five'"},
      {header(2, "ascii") + "1 2 3\n4 5\n", "cloud.pcd:13: expected 3 values a point, found 2"},
      {header(1, "ascii") + "1 2 3\n4 5 6\n",
       "cloud.pcd:13: there are more points than the 1 that the header names"},
      {binary + "\n", "cloud.pcd: the file goes on behind its points, by 1 bytes"},
      {header(3, "binary_compressed") + bytes(std::uint32_t{3}) + bytes(std::uint32_t{36}) + "abcd",
       "cloud.pcd: the file goes on behind its points, by 1 bytes"},
      {replaced(ascii, "POINTS 3\n", "POINTS 3\nPOINTS 2\n"),
       "cloud.pcd:11: there is a second line POINTS"},
      {replaced(ascii, "SIZE 4 4 4\n", ""), "cloud.pcd:10: the header has no line SIZE"},
      {replaced(ascii, "TYPE F F F\n", ""), "cloud.pcd:10: the header has no line TYPE"},
      {replaced(ascii, "VERSION 0.7", "VERSION 0.8"),
       "cloud.pcd:2: VERSION is none of 0.5, 0.6 and 0.7"},
      {header(1, "ascii", "x y z x") + "1 2 3 4\n", "cloud.pcd: there are several fields x"},
      {header(0, "ascii"), "cloud.pcd: the file holds no points"},
      {header(1, "ascii") + "nan nan nan\n", "cloud.pcd: none of the file's 1 points is finite"},
  };
  for (const auto& [content, expected] : cases) EXPECT_EQ(complaint(content), expected);
  const auto missing = read_pcd(folder_.path() / "nowhere.pcd");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().describe(), HasSubstr("nowhere.pcd: there is no such file"));
}

// Wherever a file is cut and whichever of its bytes is another, reading ends, with points or not.
/// Points of 2^33 bytes, 2^31 of them: 0 bytes, where they are counted in 64 bits.
TEST_F(PcdFile, RefusesPointsThatCannotBeCounted) {
  const auto line = [](const std::string& key, const std::string& xyz, const std::string& large,
                       const std::string& last) {
    std::string text = key + " " + xyz;
    for (int i = 0; i < 1023; ++i) text += " " + large;
    return text + " " + last + "\n";
  };
  EXPECT_THAT(complaint(line("FIELDS", "x y z", "n", "a b") + line("SIZE", "4 4 4", "8", "4 4") +
                        line("TYPE", "F F F", "U", "U U") +
                        line("COUNT", "1 1 1", "1048576", "1048576 1048573") +
                        "POINTS 2147483648\nDATA binary\n"),
              HasSubstr("names points of 8589934592 bytes"));
}

TEST_F(PcdFile, SurvivesAnyCutAndAnyWrongByte) {
  Points points;
  for (int i = 0; i < 40; ++i) points.emplace_back(0.1F * i, 1.0F, 0.0F);
  const auto file = folder_.path() / "whole.pcd";
  testing::write_with_pcl(file, points, testing::PclFormat::kBinaryCompressed,
                          Eigen::Vector4f::Zero(), {1, 0, 0, 0});
  std::ostringstream buffer;
  buffer << std::ifstream(file, std::ios::binary).rdbuf();
  // PCL pads the file with zeros to a whole page; what is not padding is well below this.
  const std::string whole = buffer.str().substr(0, 1000);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto cloud = read(whole.substr(0, size));
    ASSERT_TRUE(!cloud || cloud->points_m.size() == points.size());
  }
  std::mt19937 random(8);
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    (void)read(damaged);
  }
}

}  // namespace
}  // namespace sidestep::pcd
