#include "recorded_frames.hpp"

#include <fstream>

#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace sidestep::recorded_frames {
namespace {

TEST(ForEachLine, HandsOverWordsAndWhereTheyStand) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "list.txt";
  std::ofstream(file) << "# stamp file\n\n 1.5\ta.png  \n2 b.png # late\n   \nlast";
  std::vector<std::vector<std::string>> lines;
  std::vector<std::string> places;
  const auto read = for_each_line(file, [&](const auto& words, const auto& where) -> Result<void> {
    lines.push_back(words);
    places.push_back(where);
    return {};
  });
  ASSERT_TRUE(read) << read.error().describe();
  EXPECT_EQ(lines,
            (std::vector<std::vector<std::string>>{{"1.5", "a.png"}, {"2", "b.png"}, {"last"}}));
  const std::string name = file.string();
  EXPECT_EQ(places, (std::vector<std::string>{name + ":3", name + ":4", name + ":6"}));
}

TEST(ForEachLine, EndsWithTheFirstFailure) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "list.txt";
  std::ofstream(file) << "1\n2\n3\n";
  int handled = 0;
  const auto read = for_each_line(file, [&](const auto& words, const auto& where) -> Result<void> {
    ++handled;
    if (words[0] == "2") return fail(ErrorCode::kConfig, "no two", where);
    return {};
  });
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().message, "no two");
  EXPECT_EQ(handled, 2);
  const auto none = for_each_line(folder.path() / "none",
                                  [](const auto&, const auto&) { return Result<void>(); });
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace sidestep::recorded_frames
