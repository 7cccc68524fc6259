#include <map>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "md5.hpp"
#include "ros_messages.hpp"

namespace sidestep::testing {
namespace {

TEST(Md5, GivesTheSumsOfItsRfc) {
  EXPECT_EQ(md5(""), "d41d8cd98f00b204e9800998ecf8427e");
  EXPECT_EQ(md5("message digest"), "f96b697d7cb7938d525a2f31aaf161d0");
  EXPECT_EQ(md5("12345678901234567890123456789012345678901234567890123456789012345678901234567890"),
            "57edf4a22be3c955ac49da2e2107b67a");
}

/// What genmsg hashes (wiki.ros.org/ROS/Technical Overview, "Message serialization and msg MD5
/// sums"): constants before fields, spaces squeezed, and in place of the name of a message its sum.
class SumOfDefinition {
 public:
  explicit SumOfDefinition(const std::string& name, const std::string& definition) : name_(name) {
    std::istringstream lines(definition);
    std::string of = name;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("MSG: ", 0) == 0) {
        of = line.substr(5);
      } else if (line.rfind("=====", 0) != 0) {
        lines_[of].push_back(line);
      }
    }
  }
  [[nodiscard]] std::string sum() const { return sum_of(name_); }
  [[nodiscard]] std::size_t messages() const { return lines_.size(); }

 private:
  [[nodiscard]] std::string sum_of(const std::string& name) const {
    static const std::set<std::string> kPlain{"bool",    "uint8",  "int32",   "uint32",
                                              "float32", "string", "float64", "int16",
                                              "uint16",  "int8",   "time",    "duration"};
    std::string constants, fields;
    for (const std::string& line : lines_.at(name)) {
      if (line.empty()) continue;
      const std::size_t space = line.find(' ');
      const std::string type = line.substr(0, space);
      std::string rest = line.substr(space + 1);
      if (const std::size_t equals = rest.find('='); equals != std::string::npos) {
        std::erase(rest, ' ');
        constants += type + " " + rest + "\n";
        continue;
      }
      const std::string plain = type.substr(0, type.find('['));
      fields +=
          (kPlain.contains(plain) ? type : sum_of(full_name(plain, name))) + " " + rest + "\n";
    }
    std::string all = constants + fields;
    if (!all.empty()) all.pop_back();
    return md5(all);
  }
  /// "Header" is of std_msgs; another name without a package is of the package that it is in.
  [[nodiscard]] static std::string full_name(const std::string& type, const std::string& in) {
    if (type == "Header") return "std_msgs/Header";
    if (type.find('/') != std::string::npos) return type;
    return in.substr(0, in.find('/') + 1) + type;
  }

  std::string name_;
  std::map<std::string, std::vector<std::string>> lines_;
};

template <class Message>
class RosMessage : public ::testing::Test {};
using Messages =
    ::testing::Types<ros::Image, ros::CameraInfo, ros::PointCloud2, ros::TFMessage, ros::JointState,
                     ros::MarkerArray, ros::JointTrajectory, ros::String, ros::UInt8MultiArray>;
TYPED_TEST_SUITE(RosMessage, Messages);

TYPED_TEST(RosMessage, HasTheSumOfItsDefinition) {
  const ros::MessageType& type = ros::type_of<TypeParam>();
  const SumOfDefinition definition(std::string(type.name), std::string(type.definition));
  EXPECT_EQ(definition.sum(), type.md5sum) << type.name;
}

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> all;
  for (const int value : values) all.push_back(static_cast<std::byte>(value));
  return all;
}

TEST(RosSerialisation, IsLittleEndianWithLengthsBeforeStringsAndLists) {
  ros::JointState state;
  state.header = {0x01020304, {5, 6}, "ab"};
  state.name = {"x"};
  state.position = {1.0};
  std::vector<std::byte> written;
  ros::serialise(state, written);
  EXPECT_EQ(written, bytes({4,   3,   2, 1, 5, 0,    0,    0, 6, 0, 0,   0, 2, 0, 0, 0,
                            'a', 'b', 1, 0, 0, 0,    1,    0, 0, 0, 'x', 1, 0, 0, 0, 0,
                            0,   0,   0, 0, 0, 0xf0, 0x3f, 0, 0, 0, 0,   0, 0, 0, 0}));
}

ros::MarkerArray two_markers() {
  ros::MarkerArray array;
  for (int i = 0; i < 2; ++i) {
    ros::Marker& marker = array.markers.emplace_back();
    marker.header = {7, {8, 9}, "world"};
    marker.ns = "occupied";
    marker.id = i;
    marker.type = ros::Marker::kCubeList;
    marker.pose = {{1.0, 2.0, 3.0}, {0.1, 0.2, 0.3, 0.4}};
    marker.scale = {0.1, 0.2, 0.3};
    marker.color = {0.1F, 0.2F, 0.3F, 0.4F};
    marker.lifetime = {-1, 5};
    marker.frame_locked = 1;
    marker.points = {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}};
    marker.colors = {{1.0F, 0.0F, 0.0F, 1.0F}};
    marker.text = "text";
  }
  return array;
}

TEST(RosSerialisation, ReadsWhatItWrote) {
  std::vector<std::byte> written;
  ros::serialise(two_markers(), written);
  const auto read = ros::parse<ros::MarkerArray>(written);
  ASSERT_TRUE(read) << read.error().describe();
  ASSERT_EQ(read->markers.size(), 2U);
  const ros::Marker& marker = read->markers[1];
  EXPECT_EQ(marker.id, 1);
  EXPECT_EQ(marker.ns, "occupied");
  EXPECT_EQ(marker.pose.orientation.z, 0.3);
  EXPECT_EQ(marker.lifetime, (ros::Duration{-1, 5}));
  EXPECT_EQ(marker.points[1].y, 5.0);
  EXPECT_EQ(marker.text, "text");
  std::vector<std::byte> again;
  ros::serialise(*read, again);
  EXPECT_EQ(again, written);
}

TEST(RosSerialisation, RefusesBytesThatAreTooFewOrTooMany) {
  std::vector<std::byte> written;
  ros::serialise(two_markers(), written);
  for (std::size_t size = 0; size < written.size(); ++size) {
    EXPECT_FALSE(ros::parse<ros::MarkerArray>(std::span(written).first(size))) << size;
  }
  written.push_back(std::byte{0});
  const auto read = ros::parse<ros::MarkerArray>(written);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, ::testing::HasSubstr("visualization_msgs/MarkerArray"));
}

TEST(RosSerialisation, RefusesALengthBeyondTheBytesWithoutMakingRoomForIt) {
  // 4,294,967,295 markers, numbers or letters.
  EXPECT_FALSE(ros::parse<ros::MarkerArray>(bytes({255, 255, 255, 255})));
  EXPECT_FALSE(ros::parse<ros::String>(bytes({255, 255, 255, 255})));
  EXPECT_FALSE(
      ros::parse<ros::UInt8MultiArray>(bytes({0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255})));
}

}  // namespace
}  // namespace sidestep::testing
