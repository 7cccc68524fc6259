#include "recorded_frames.hpp"

#include <gtest/gtest.h>

namespace sidestep::recorded_frames {
namespace {

struct Choice {
  int first_frame = 0;
  int max_frames = 0;
  int stride = 1;
};

std::vector<int> chosen(const Choice& choice) {
  const auto frames = chosen_frames<int>({0, 1, 2, 3, 4, 5, 6}, choice, "frames", "folder");
  return frames ? *frames : std::vector<int>{};
}

TEST(ChosenFrames, AreEveryFewFromTheFirstUpToTheMost) {
  EXPECT_EQ(chosen({}), (std::vector<int>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(chosen({.first_frame = 2, .stride = 2}), (std::vector<int>{2, 4, 6}));
  EXPECT_EQ(chosen({.first_frame = 1, .max_frames = 2, .stride = 3}), (std::vector<int>{1, 4}));
  EXPECT_EQ(chosen({.first_frame = 6, .max_frames = 5}), (std::vector<int>{6}));
}

TEST(ChosenFrames, AreAtLeastOne) {
  const auto none = chosen_frames<int>({0, 1}, Choice{.first_frame = 2}, "point clouds", "clouds/");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kConfig);
  EXPECT_EQ(none.error().where, "clouds/");
  EXPECT_EQ(none.error().message, "first_frame is 2, but there are only 2 point clouds");
}

}  // namespace
}  // namespace sidestep::recorded_frames
