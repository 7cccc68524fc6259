#include <sys/stat.h>

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/core/file.hpp>
#include <sidestep/core/xml_tags.hpp>

#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Files : public testing::Test {
 protected:
  testing_support::TemporaryFolder folder_;
};

TEST_F(Files, AreReadUpToALimit) {
  const fs::path file = folder_.write("ten", std::string("a\0b\n\r\n    ", 10));
  EXPECT_EQ(read_file(file, 10).value(), std::string("a\0b\n\r\n    ", 10));
  const auto larger = read_file(file, 9);
  ASSERT_FALSE(larger);
  EXPECT_EQ(larger.error().code, ErrorCode::kIo);
  EXPECT_EQ(larger.error().describe(),
            file.string() + ": the file has 10 bytes; 9 bytes at most are read");
  EXPECT_EQ(read_file(folder_.write("empty", "")).value(), "");
}

TEST_F(Files, AreRegularOnes) {
  const auto why = [](const fs::path& file) {
    const auto text = read_file(file);
    return text ? "read" : text.error().message;
  };
  EXPECT_EQ(why(folder_.path() / "none"), "there is no such file");
  EXPECT_EQ(why(folder_.path()), "this is a folder, not a file");
  EXPECT_EQ(why("/dev/zero"), "this is a pipe or a device, not a file");
  const fs::path pipe = folder_.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(why(pipe), "this is a pipe or a device, not a file");
  EXPECT_THAT(why(folder_.path() / std::string(5000, 'x')), HasSubstr("cannot be read: "));
}

TEST_F(Files, AreReplacedAsAWhole) {
  const fs::path file = folder_.write("a", "old");
  ASSERT_TRUE(write_file(file, "new"));
  EXPECT_EQ(read_file(file).value(), "new");
  // What cannot be written leaves the old one, and nothing beside it.
  fs::create_directory(folder_.path() / "b");
  folder_.write("b/within", "kept");
  const auto into_folder = write_file(folder_.path() / "b", "text");
  ASSERT_FALSE(into_folder);
  EXPECT_EQ(into_folder.error().code, ErrorCode::kIo);
  EXPECT_EQ(read_file(folder_.path() / "b/within").value(), "kept");
  EXPECT_FALSE(write_file(folder_.path() / "none/a", "text"));
  EXPECT_FALSE(write_file("/dev/full", "text"));
  EXPECT_TRUE(write_file("/dev/null", "text"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  fs::create_symlink(file, folder_.path() / "link");
  ASSERT_TRUE(write_file(folder_.path() / "link", "through it"));
  EXPECT_TRUE(fs::is_symlink(folder_.path() / "link"));
  EXPECT_EQ(read_file(file).value(), "through it");
  std::size_t left = 0;
  for (const auto& entry : fs::directory_iterator(folder_.path())) left += entry.exists();
  EXPECT_EQ(left, 3u);
}

std::string nested(int depth) {
  std::string text;
  for (int i = 0; i < depth; ++i) text += "<a b='>'>";
  for (int i = 0; i < depth; ++i) text += "</a>";
  return text;
}

TEST(XmlDepth, IsBounded) {
  EXPECT_TRUE(check_xml_depth(nested(200), "f.xml"));
  const auto deeper = check_xml_depth(nested(201), "f.xml");
  ASSERT_FALSE(deeper);
  EXPECT_EQ(deeper.error().describe(),
            "f.xml:1:1801: XML elements are nested 201 deep; 200 at most are read");
  const auto below = check_xml_depth("<!--\n-->\n " + nested(201), "f.xml");
  ASSERT_FALSE(below);
  EXPECT_EQ(below.error().where, "f.xml:3:1802");
}

TEST(XmlDepth, CountsElementsAlone) {
  std::string beside;
  for (int i = 0; i < 1000; ++i) beside += "<a/><b c=\"/\"></b><!-- <d> --><![CDATA[<e>]]>";
  EXPECT_TRUE(check_xml_depth("<r>" + beside + "</r>", "f.xml"));
  // Ends that a parser does not take for ends.
  std::string hidden;
  for (int i = 0; i < 300; ++i) hidden += "<a><!-- </a> --><![CDATA[</a>]]>";
  EXPECT_FALSE(check_xml_depth(hidden, "f.xml"));
  EXPECT_FALSE(check_xml_depth("<?x > " + nested(300) + "?>", "f.xml"));
}

}  // namespace
}  // namespace sidestep
