#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

using ::testing::HasSubstr;

constexpr CameraIntrinsics kTiny{4, 3, 10.0, 10.0, 1.5, 1.0};
constexpr std::size_t kPixels = 12;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

/// Appends a number byte by byte.
void put(std::uint32_t number, int bytes, bool is_big, std::vector<std::uint8_t>& into) {
  for (int i = 0; i < bytes; ++i) {
    const int shift = 8 * (is_big ? bytes - 1 - i : i);
    into.push_back(static_cast<std::uint8_t>(number >> shift));
  }
}

struct Layout {
  bool is_float = false;
  bool is_big = false;
  int padding_bytes = 0;
};

/// An image of raw numbers, row by row, with each row's padding filled with ones.
Image image_of(const std::vector<std::uint32_t>& raw, const Layout& layout) {
  const int bytes = layout.is_float ? 4 : 2;
  std::vector<std::uint8_t> data;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    put(raw[i], bytes, layout.is_big, data);
    const bool ends_row = (i + 1) % static_cast<std::size_t>(kTiny.width_px) == 0;
    if (ends_row) data.insert(data.end(), static_cast<std::size_t>(layout.padding_bytes), 0xff);
  }
  Image message;
  message.encoding = layout.is_float ? "32FC1" : "16UC1";
  message.width = 4;
  message.height = 3;
  message.is_bigendian = layout.is_big ? 1 : 0;
  message.step = static_cast<std::uint32_t>(4 * bytes + layout.padding_bytes);
  message.data.assign(data.begin(), data.end());
  return message;
}

Image millimetres(const std::vector<std::uint32_t>& raw) { return image_of(raw, {}); }

Image metres(const std::vector<float>& values) {
  std::vector<std::uint32_t> raw;
  for (const float value : values) raw.push_back(std::bit_cast<std::uint32_t>(value));
  return image_of(raw, {.is_float = true});
}

class EveryLayout : public ::testing::TestWithParam<std::tuple<bool, bool, int>> {
 protected:
  [[nodiscard]] static Layout layout() {
    const auto [is_float, is_big, padding] = GetParam();
    return {is_float, is_big, padding};
  }
};

TEST_P(EveryLayout, IsReadPixelByPixel) {
  std::vector<std::uint32_t> raw;
  std::vector<float> expected;
  for (std::uint32_t i = 0; i < kPixels; ++i) {
    const std::uint32_t mm = 300 + 701 * i;
    const auto depth_m = static_cast<float>(mm / 1000.0);
    raw.push_back(layout().is_float ? std::bit_cast<std::uint32_t>(depth_m) : mm);
    expected.push_back(depth_m);
  }
  const auto image = depth_image(image_of(raw, layout()), kTiny, {0.0, 100.0});
  ASSERT_TRUE(image) << image.error().describe();
  EXPECT_EQ(image->depth_m, expected);
  EXPECT_EQ(image->camera.fx_px, kTiny.fx_px);
}

INSTANTIATE_TEST_SUITE_P(Images, EveryLayout,
                         ::testing::Combine(::testing::Bool(), ::testing::Bool(),
                                            ::testing::Values(0, 1, 12)));

TEST(DepthImages, TellNoReturnFromInvalidInMillimetres) {
  const auto image = depth_image(
      millimetres({0, 65535, 1, 999, 1000, 2000, 2001, 65534, 5, 5, 5, 5}), kTiny, {1.0, 2.0});
  ASSERT_TRUE(image) << image.error().describe();
  const auto& d = image->depth_m;
  EXPECT_EQ(d[0], 0.0F);
  EXPECT_TRUE(std::isnan(d[1]));
  EXPECT_EQ(d[3], 0.0F) << "nearer than asked for";
  EXPECT_EQ(d[4], 1.0F);
  EXPECT_EQ(d[5], 2.0F);
  EXPECT_EQ(d[6], 0.0F) << "farther than asked for";
  EXPECT_EQ(d[7], 0.0F);
}

/// REP 117 and 118: NaN is invalid, +inf too far to see, -inf too near.
TEST(DepthImages, TellNoReturnFromInvalidInMetres) {
  const auto image = depth_image(
      metres({0.0F, kNaN, kInf, -kInf, -1.0F, 0.5F, 1.0F, 2.0F, 2.1F, 1e30F, 1.5F, 1.5F}), kTiny,
      {1.0, 2.0});
  ASSERT_TRUE(image) << image.error().describe();
  const auto& d = image->depth_m;
  EXPECT_EQ(d[0], 0.0F);
  EXPECT_TRUE(std::isnan(d[1]));
  EXPECT_EQ(d[2], 0.0F);
  EXPECT_TRUE(std::isnan(d[3]));
  EXPECT_TRUE(std::isnan(d[4]));
  EXPECT_EQ(d[5], 0.0F);
  EXPECT_EQ(d[6], 1.0F);
  EXPECT_EQ(d[7], 2.0F);
  EXPECT_EQ(d[8], 0.0F);
  EXPECT_EQ(d[9], 0.0F);
}

TEST(DepthImages, SayWhatIsWrongWithThem) {
  const Image good = millimetres(std::vector<std::uint32_t>(kPixels, 1000));
  std::vector<std::pair<Image, std::string>> bad(6, {good, ""});
  bad[0].first.encoding = "bgr8";
  bad[0].second = "'bgr8'";
  bad[1].first.width = 5;
  bad[1].second = "5 x 3 pixels";
  bad[2].first.step = 7;
  bad[2].second = "7 bytes";
  bad[3].first.data.pop_back();
  bad[3].second = "23 bytes";
  bad[4].first.step = 0xffffffffU;
  bad[4].second = "its size says 8589934598";
  bad[5].first.height = 0;
  bad[5].second = "4 x 0 pixels";
  for (const auto& [message, expected] : bad) {
    const auto image = depth_image(message, kTiny, {});
    ASSERT_FALSE(image) << expected;
    EXPECT_EQ(image.error().code, ErrorCode::kBadFrame);
    EXPECT_THAT(image.error().message, HasSubstr(expected));
  }
}

/// The last row needs no padding behind it.
TEST(DepthImages, MayEndWithTheirLastPixel) {
  Image message = image_of(std::vector<std::uint32_t>(kPixels, 1000), {.padding_bytes = 6});
  message.data.resize(message.data.size() - 6);
  EXPECT_TRUE(depth_image(message, kTiny, {}));
}

TEST(DepthImages, ComeBackAsTheyWereWritten) {
  const DepthImage image{
      kTiny, {0.0F, kNaN, 0.5F, 1.234F, 9.999F, 3.0F, 2.0F, 1.0F, 4.0F, 5.0F, 6.0F, 7.0F}};
  for (const DepthEncoding encoding : {DepthEncoding::k16UC1, DepthEncoding::k32FC1}) {
    const Image message = to_image(image, encoding, Stamp{1'500'000'000}, "camera");
    EXPECT_EQ(message.header.frame_id, "camera");
    EXPECT_EQ(to_stamp(message.header.stamp), Stamp{1'500'000'000});
    const auto read = depth_image(message, kTiny, {});
    ASSERT_TRUE(read) << read.error().describe();
    EXPECT_TRUE(std::isnan(read->depth_m[1]));
    for (const std::size_t i : {0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}) {
      EXPECT_EQ(read->depth_m[i], image.depth_m[i]) << i;
    }
  }
}

TEST(DepthImages, HaveNoMillimetresBeyondSixteenBits) {
  const DepthImage image{kTiny, std::vector<float>(kPixels, 70.0F)};
  const Image message = to_image(image, DepthEncoding::k16UC1, Stamp{}, "camera");
  EXPECT_EQ(depth_image(message, kTiny, {0.0, 100.0})->depth_m, std::vector<float>(kPixels, 0.0F));
}

}  // namespace
}  // namespace sidestep::ros_messages
