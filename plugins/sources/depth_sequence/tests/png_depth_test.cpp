#include "../png_depth.hpp"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sequence_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::depth_sequence {
namespace {

using ::testing::HasSubstr;

class PngDepth : public ::testing::Test {
 protected:
  testing_support::TemporaryFolder folder_;
};

std::vector<std::uint16_t> noise(int count) {
  std::mt19937 random(1);
  std::vector<std::uint16_t> values;
  for (int i = 0; i < count; ++i) values.push_back(static_cast<std::uint16_t>(random()));
  return values;
}

TEST_F(PngDepth, ReadsBackWhatWasWritten) {
  for (const bool interlaced : {false, true}) {
    const auto file = folder_.path() / "depth.png";
    const auto values = noise(33 * 21);
    testing::write_png(file, 33, 21, values, {.interlaced = interlaced});
    const auto size = read_png_size(file);
    ASSERT_TRUE(size) << size.error().describe();
    EXPECT_EQ(*size, (ImageSize{33, 21}));
    const auto image = read_png_depth(file);
    ASSERT_TRUE(image) << image.error().describe();
    EXPECT_EQ(image->values, values);
  }
}

TEST_F(PngDepth, RefusesOtherKindsOfImage) {
  const auto file = folder_.path() / "other.png";
  testing::write_png(file, 4, 4, {}, {.bits = 8});
  EXPECT_THAT(read_png_depth(file).error().describe(), HasSubstr("one channel of 8 bits;"));
  testing::write_png(file, 4, 4, {}, {.bits = 16, .colour_type = 2});
  EXPECT_THAT(read_png_depth(file).error().describe(), HasSubstr("three channels of 16 bits;"));
  testing::write_png(file, 4, 4, {}, {.bits = 8, .colour_type = 6});
  EXPECT_THAT(read_png_size(file).error().describe(), HasSubstr("four channels of 8 bits;"));
}

TEST_F(PngDepth, RefusesAHeaderThatPromisesMoreThanTheFileCanHold) {
  const auto file = folder_.path() / "small.png";
  testing::write_png(file, 16, 12, noise(16 * 12));
  std::string bytes = testing::read_file(file);
  bytes[18] = bytes[22] = 0x40;  // 16,384 x 16,384, the most that is read
  bytes[19] = bytes[23] = 0;
  const auto image = read_png_depth(folder_.write("lies.png", bytes));
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, ErrorCode::kBadFrame);
  EXPECT_THAT(image.error().describe(),
              AllOf(HasSubstr("lies.png"), HasSubstr("16384 x 16384 pixels, which "),
                    HasSubstr("bytes cannot hold")));
}

/// With the checksum that such a chunk has.
std::string with_chunk_crc(std::string png, std::size_t chunk, std::size_t data_bytes) {
  std::uint32_t crc = 0xffffffff;
  for (std::size_t i = 0; i < data_bytes + 4; ++i) {
    crc ^= static_cast<unsigned char>(png[chunk + 4 + i]);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ (crc & 1U ? 0xedb88320U : 0U);
  }
  crc = ~crc;
  for (int i = 0; i < 4; ++i) {
    png[chunk + 8 + data_bytes + static_cast<std::size_t>(i)] =
        static_cast<char>(crc >> (24 - 8 * i));
  }
  return png;
}

TEST_F(PngDepth, RefusesAFileThatHoldsMoreThanItsImage) {
  const auto file = folder_.path() / "depth.png";
  testing::write_png(file, 16, 12, noise(16 * 12));
  const std::string whole = testing::read_file(file);
  EXPECT_THAT(
      read_png_depth(folder_.write("more.png", whole + "x")).error().describe(),
      HasSubstr(
          "more.png: the PNG data are truncated or damaged: the file goes on behind the image"));
  // Half the rows are there, and the header does not tell of them.
  std::string fewer = whole;
  constexpr std::size_t kHeader = 8, kHeaderBytes = 13;
  fewer[23] = 6;
  fewer = with_chunk_crc(std::move(fewer), kHeader, kHeaderBytes);
  ASSERT_EQ(with_chunk_crc(whole, kHeader, kHeaderBytes), whole) << "the checksum is PNG's";
  const auto image = read_png_depth(folder_.write("fewer.png", fewer));
  ASSERT_FALSE(image) << "rows were dropped";
  EXPECT_EQ(image.error().code, ErrorCode::kBadFrame);
}

TEST_F(PngDepth, FailsCleanlyWhereverTheFileIsCut) {
  const auto file = folder_.path() / "whole.png";
  testing::write_png(file, 40, 30, noise(40 * 30));
  const std::string whole = testing::read_file(file);
  for (std::size_t size = 0; size < whole.size(); size += size < 64 ? 1 : 97) {
    const auto image = read_png_depth(folder_.write("cut.png", whole.substr(0, size)));
    ASSERT_FALSE(image) << size;
    EXPECT_EQ(image.error().code, ErrorCode::kBadFrame) << size;
    EXPECT_THAT(image.error().where, HasSubstr("cut.png"));
  }
}

TEST_F(PngDepth, SurvivesAnyFlippedByte) {
  const auto file = folder_.path() / "whole.png";
  testing::write_png(file, 16, 12, noise(16 * 12));
  const std::string whole = testing::read_file(file);
  int refused = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    const auto image = read_png_depth(folder_.write("damaged.png", damaged));
    if (image) continue;
    ++refused;
    EXPECT_EQ(image.error().code, ErrorCode::kBadFrame);
  }
  // Every chunk has a checksum.
  EXPECT_GE(refused, static_cast<int>(whole.size()) - 8);
}

TEST_F(PngDepth, SaysWhatIsNoPngAndWhatIsNotThere) {
  EXPECT_THAT(read_png_depth(folder_.write("text.png", "P5 640 480")).error().message,
              HasSubstr("not a PNG file"));
  const auto absent = read_png_depth(folder_.path() / "absent.png");
  EXPECT_EQ(absent.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_png_depth(folder_.path()).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace sidestep::depth_sequence
