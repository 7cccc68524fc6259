// Bags that are cut off or damaged: what comes before the break is read, the break is named, and
// nothing crashes or hangs.

#include <algorithm>
#include <random>
#include <ranges>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../bag.hpp"
#include "../recording.hpp"
#include "bag_writing.hpp"

namespace sidestep::rosbag::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int kImages = 12;
constexpr std::size_t kPixelBytes = std::size_t{2} * 40 * 30;

/// The bytes of the pixels of image i.
std::string pixels_of(int i) {
  std::string pixels;
  while (pixels.size() < kPixelBytes) {
    pixels += static_cast<char>((1000 + i) & 0xff);
    pixels += static_cast<char>((1000 + i) >> 8);
  }
  return pixels;
}

/// The first frames of the flat bag, as they should be.
void expect_first_frames(const std::vector<Frame>& frames) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].stamp, after_s(0.1 * static_cast<double>(i)));
    const auto& image = std::get<DepthImage>(frames[i].measurement);
    const auto expected = static_cast<float>((1000 + static_cast<int>(i)) / 1000.0);
    EXPECT_EQ(image.depth_m, std::vector<float>(40 * 30, expected)) << "frame " << i;
  }
}

/// Every place where something ends or begins, and a few hundred others.
std::vector<std::size_t> places_in(const std::string& content, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::size_t> anywhere(0, content.size() - 1);
  std::vector<std::size_t> places{0, 1, 12, 13, 14, 17, 4096, content.size() - 1};
  for (int i = 0; i < 300; ++i) places.push_back(anywhere(random));
  for (std::size_t at = 0; (at = content.find("op=", at)) != std::string::npos; ++at) {
    for (const int shift : {-9, -4, 0, 4, 40}) {
      places.push_back(std::min(content.size() - 1, at + static_cast<std::size_t>(shift)));
    }
  }
  return places;
}

class CutOff : public ::testing::TestWithParam<std::uint32_t> {};

/// The oracle: an image is whole where all its pixels are in the file.
TEST_P(CutOff, GivesTheFramesBeforeTheBreakAndSaysWhereItIs) {
  const testing_support::TemporaryFolder folder;
  write_flat_bag(folder.path() / "whole.bag", kImages, {.chunk_bytes = GetParam()});
  const std::string content = file_content(folder.path() / "whole.bag");
  std::vector<std::size_t> ends;
  for (int i = 0; i < kImages; ++i) {
    const std::size_t at = content.find(pixels_of(i));
    ASSERT_NE(at, std::string::npos);
    ends.push_back(at + kPixelBytes);
  }
  for (const std::size_t cut : places_in(content, GetParam())) {
    SCOPED_TRACE(cut);
    const auto file = folder.write("cut.bag", content.substr(0, cut));
    const Outcome outcome = read_all(options_of(file));
    const auto whole = std::ranges::count_if(ends, [&](std::size_t end) { return end <= cut; });
    ASSERT_THAT(outcome.frames, SizeIs(static_cast<std::size_t>(whole)));
    expect_first_frames(outcome.frames);
    ASSERT_THAT(outcome.errors, SizeIs(1));
    const Error& error = outcome.errors[0];
    EXPECT_EQ(error.code, whole > 0 ? ErrorCode::kBadFrame : ErrorCode::kIo) << error.describe();
    EXPECT_THAT(error.message, HasSubstr("at byte "));
  }
}

INSTANTIATE_TEST_SUITE_P(Bags, CutOff, ::testing::Values(1U, 6000U, 1U << 20));

struct Compressed {
  const char* name;
  ::rosbag::compression::CompressionType type;
};

class CompressedBag : public ::testing::TestWithParam<Compressed> {
 protected:
  /// Each message in a chunk of its own: camera info, tf, images.
  void SetUp() override {
    write_flat_bag(folder_.path() / "whole.bag", kImages, {GetParam().type, 1});
    content_ = file_content(folder_.path() / "whole.bag");
    const std::string header = "compression=" + std::string(GetParam().name);
    for (std::size_t at = 0; (at = content_.find(header, at)) != std::string::npos; ++at) {
      chunks_.push_back(at);
    }
    ASSERT_THAT(chunks_, SizeIs(kImages + 2));
  }

  testing_support::TemporaryFolder folder_;
  std::string content_;
  std::vector<std::size_t> chunks_;
};

TEST_P(CompressedBag, CutOffGivesTheFramesOfWholeChunks) {
  for (const std::size_t cut : places_in(content_, 7)) {
    SCOPED_TRACE(cut);
    const auto file = folder_.write("cut.bag", content_.substr(0, cut));
    const Outcome outcome = read_all(options_of(file));
    // Chunks that begin before the cut; of the last of these, it depends.
    const auto begun = std::ranges::count_if(chunks_, [&](std::size_t at) { return at < cut; });
    EXPECT_GE(static_cast<std::ptrdiff_t>(outcome.frames.size()) + 3, begun);
    EXPECT_LE(static_cast<std::ptrdiff_t>(outcome.frames.size()) + 2,
              std::max<std::ptrdiff_t>(begun, 2));
    expect_first_frames(outcome.frames);
    EXPECT_THAT(outcome.errors, SizeIs(1));
  }
}

/// A chunk that is damaged costs what is in it, not what comes later.
TEST_P(CompressedBag, LosesTheFramesOfADamagedChunkOnly) {
  const std::size_t damaged = 5;  // the fourth image's
  std::string content = content_;
  for (std::size_t i = 60; i < 90; ++i) content[chunks_[damaged] + i] ^= '\x5a';
  const Outcome outcome = read_all(options_of(folder_.write("damaged.bag", content)));
  ASSERT_THAT(outcome.frames, SizeIs(kImages - 1));
  for (std::size_t i = 0; i < outcome.frames.size(); ++i) {
    const std::size_t number = i < damaged - 2 ? i : i + 1;
    EXPECT_EQ(outcome.frames[i].stamp, after_s(0.1 * static_cast<double>(number)));
  }
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_EQ(outcome.errors[0].code, ErrorCode::kBadFrame);
  // The record begins with two lengths before the first field.
  const std::string at = "at byte " + std::to_string(chunks_[damaged] - 8);
  EXPECT_THAT(outcome.errors[0].message,
              AllOf(HasSubstr("is damaged"), HasSubstr(at), HasSubstr("1600000000.210000000 s")));
}

INSTANTIATE_TEST_SUITE_P(Bags, CompressedBag,
                         ::testing::Values(Compressed{"bz2", ::rosbag::compression::BZ2},
                                           Compressed{"lz4", ::rosbag::compression::LZ4}),
                         [](const auto& tested) { return std::string(tested.param.name); });

/// A file as it is while a recorder writes it, or after it was killed: no index, and a last chunk
/// whose header does not say yet how long it is.
TEST(UnclosedBag, GivesWhatWasWritten) {
  const testing_support::TemporaryFolder folder;
  const auto active = folder.path() / "active.bag";
  std::string content;
  {
    BagWriter bag(active, {.chunk_bytes = 6000});
    bag.write("/camera/depth/camera_info", after_s(0.0),
              ros_messages::to_camera_info(kCamera, after_s(0.0), "camera"));
    bag.write("/tf_static", after_s(0.0),
              tf_message(Transform::Identity(), after_s(0.0), "map", "camera"));
    for (int i = 0; i < kImages; ++i) {
      bag.write("/camera/depth/image", after_s(0.1 * i), flat_image(1000 + i, after_s(0.1 * i)));
    }
    content = file_content(active);
  }
  const auto whole = std::ranges::count_if(std::views::iota(0, kImages), [&](int i) {
    return content.find(pixels_of(i)) != std::string::npos;
  });
  EXPECT_GT(whole, 5) << "what the recorder keeps in memory is not in the file";
  const Outcome outcome = read_all(options_of(folder.write("killed.bag", content)));
  EXPECT_THAT(outcome.frames, SizeIs(static_cast<std::size_t>(whole)));
  expect_first_frames(outcome.frames);
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message, HasSubstr("at byte "));
}

/// A connection whose record was in the damaged chunk is found in the index.
TEST(DamagedBag, KnowsTheTopicsOfADamagedFirstChunk) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "whole.bag";
  {
    BagWriter bag(file, {::rosbag::compression::BZ2, 1});
    for (int i = 0; i < 3; ++i) {
      bag.write("/camera/depth/image", after_s(i), flat_image(1000 + i, after_s(i)));
    }
  }
  std::string content = file_content(file);
  const std::size_t chunk = content.find("compression=bz2");
  for (std::size_t i = 60; i < 90; ++i) content[chunk + i] ^= '\x5a';
  Options options = options_of(folder.write("damaged.bag", content));
  options.camera = {35.0, 35.0, 19.5, 14.5};
  auto bag = Bag::open(options.path);
  ASSERT_TRUE(bag);
  conformance::RecordingLog log;
  const auto recording = read_recording(**bag, options, log);
  ASSERT_TRUE(recording) << recording.error().describe();
  EXPECT_THAT(recording->measurements, SizeIs(2));
  EXPECT_EQ(log.count(LogLevel::kWarning), 1);
}

/// A message fewer than the chunk's index names; the records are whole, and all sizes agree.
TEST(DamagedBag, CountsTheMessagesAgainstTheIndex) {
  const testing_support::TemporaryFolder folder;
  write_flat_bag(folder.path() / "whole.bag", kImages, {});
  std::string content = file_content(folder.path() / "whole.bag");
  // The record of an image becomes one that says nothing: another of the index, of no messages.
  const std::size_t at = content.find(pixels_of(4));
  const std::size_t op = content.rfind("op=", at);
  ASSERT_NE(op, std::string::npos);
  ASSERT_EQ(content[op + 3], '\x02');
  content[op + 3] = '\x06';  // a chunk's info
  const Outcome outcome = read_all(options_of(folder.write("fewer.bag", content)));
  EXPECT_THAT(outcome.frames, SizeIs(kImages - 1));
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message,
              HasSubstr("its chunks should hold 12 messages on /camera/depth/image, and hold 11"));
}

/// Of two connections of one number, whose are the messages?
TEST(DamagedBag, RefusesAConnectionThatIsToldTwiceDifferently) {
  const testing_support::TemporaryFolder folder;
  write_flat_bag(folder.path() / "whole.bag", 3, {});
  std::string content = file_content(folder.path() / "whole.bag");
  const std::size_t first = content.find("topic=/camera/depth/image");
  const std::size_t again = content.find("topic=/camera/depth/image", first + 30);
  ASSERT_NE(again, std::string::npos);
  content[first + 24] = 'f';
  const Outcome outcome = read_all(options_of(folder.write("other.bag", content)));
  EXPECT_THAT(outcome.frames, SizeIs(0));
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message, HasSubstr("a connection's record is damaged"));
}

/// Flips bits anywhere, some 800 times: it must end, without a crash, and hand out nothing but the
/// bag's frames, whose pixels are those that were not hit.
TEST(DamagedBag, NeitherCrashesNorHangsNorInventsFrames) {
  const testing_support::TemporaryFolder folder;
  std::mt19937 random(3);
  for (const auto compression : {::rosbag::compression::Uncompressed, ::rosbag::compression::BZ2,
                                 ::rosbag::compression::LZ4}) {
    write_flat_bag(folder.path() / "whole.bag", kImages, {compression, 6000});
    const std::string whole = file_content(folder.path() / "whole.bag");
    std::vector<std::size_t> places = places_in(whole, 11);
    std::ranges::shuffle(places, random);
    for (std::size_t i = 0; i + 3 < places.size(); i += 3) {
      std::string content = whole;
      for (std::size_t k = i; k < i + 3; ++k) {
        content[places[k]] = static_cast<char>(content[places[k]] ^ (1 << random() % 8));
      }
      SCOPED_TRACE(i);
      const Outcome outcome = read_all(options_of(folder.write("damaged.bag", content)));
      EXPECT_LE(outcome.frames.size(), std::size_t{kImages});
      for (const Frame& frame : outcome.frames) {
        std::vector<float> depths = std::get<DepthImage>(frame.measurement).depth_m;
        const std::vector<float> all = depths;
        std::ranges::nth_element(depths, depths.begin() + 600);
        const float usual_m = depths[600];
        if (usual_m == 0.0F) continue;  // the byte order was hit: beyond depth_max_m
        EXPECT_GE(usual_m, 0.9995F);
        EXPECT_LE(usual_m, 1.0115F);
        EXPECT_GE(std::ranges::count(all, usual_m), 1197);
      }
    }
  }
}

}  // namespace
}  // namespace sidestep::rosbag::testing
