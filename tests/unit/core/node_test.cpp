#include <gtest/gtest.h>

#include <sidestep/core/node.hpp>

namespace sidestep {
namespace {

Node scalar(std::string text, bool quoted = false) {
  return Node(Node::Scalar{std::move(text), quoted}, {"dir/a.yaml", 3, 5});
}

TEST(Node, ReadsNumbersStrictly) {
  EXPECT_EQ(scalar("12").as_int().value(), 12);
  EXPECT_EQ(scalar("-3").as_int().value(), -3);
  EXPECT_EQ(scalar("+3").as_int().value(), 3);
  EXPECT_EQ(scalar("1e-3").as_double().value(), 1e-3);
  EXPECT_EQ(scalar("12").as_double().value(), 12.0);
  for (const char* text :
       {"12x", "", "+-3", "++3", "+", "1.5", "1e3", "0x10", "99999999999999999999"}) {
    EXPECT_FALSE(scalar(text).as_int()) << text;
  }
  for (const char* text :
       {"1.0.0", "abc", "", "+-3", "++3", "+", ".inf", "-.inf", ".nan", "inf", "nan", "1e999"}) {
    EXPECT_FALSE(scalar(text).as_double()) << text;
  }
  EXPECT_FALSE(scalar("12", true).as_int()) << "a quoted number is a string";
  EXPECT_FALSE(scalar("12", true).as_double());
}

TEST(Node, ReadsBooleansStrictly) {
  EXPECT_TRUE(scalar("true").as_bool().value());
  EXPECT_FALSE(scalar("false").as_bool().value());
  for (const char* text : {"yes", "True", "1", "on"}) EXPECT_FALSE(scalar(text).as_bool()) << text;
  EXPECT_FALSE(scalar("true", true).as_bool());
}

TEST(Node, ErrorsSayWhereAndWhatWasFound) {
  const auto number = scalar("abc").as_double();
  ASSERT_FALSE(number);
  EXPECT_EQ(number.error().describe(), "dir/a.yaml:3:5: expected a number, found a string 'abc'");
  const auto infinite = scalar(".inf").as_double();
  ASSERT_FALSE(infinite);
  EXPECT_EQ(infinite.error().message, "expected a finite number, found '.inf'");
}

TEST(Node, ListsOfNumbersHaveTheirSize) {
  const Node list(Node::List{scalar("1"), scalar("2.5")}, {"a.yaml", 1, 1});
  EXPECT_EQ(list.as_doubles().value(), (std::vector<double>{1.0, 2.5}));
  EXPECT_TRUE(list.as_doubles(2));
  EXPECT_FALSE(list.as_doubles(3));
  EXPECT_FALSE(scalar("1").as_doubles());
  EXPECT_FALSE(Node(Node::List{scalar("x")}, {}).as_doubles());
}

TEST(Node, PathsAreRelativeToTheFileThatNamesThem) {
  EXPECT_EQ(scalar("../scenes/b.yaml").as_path().value(), "scenes/b.yaml");
  EXPECT_EQ(scalar("/abs/b.yaml").as_path().value(), "/abs/b.yaml");
  const Node from_command_line(Node::Scalar{"b.yaml", false}, {"--set source.path=b.yaml", 0, 0});
  EXPECT_EQ(from_command_line.as_path().value(), "b.yaml");
}

TEST(Node, FindsKeysOfMapsOnly) {
  Node::Map entries(1);
  entries[0].key = "a";
  entries[0].value = scalar("1");
  const Node map(std::move(entries), {});
  ASSERT_NE(map.find("a"), nullptr);
  EXPECT_EQ(map.find("b"), nullptr);
  EXPECT_EQ(scalar("a").find("a"), nullptr);
  EXPECT_TRUE(Node().is_null());
}

TEST(NearestName, FindsTyposAndNothingFarFetched) {
  const std::vector<std::string> names = {"resolution_m", "size_vox", "max_range_m"};
  EXPECT_EQ(nearest_name("resolutoin_m", names), "resolution_m");
  EXPECT_EQ(nearest_name("sizevox", names), "size_vox");
  EXPECT_EQ(nearest_name("xyz", names), "");
  EXPECT_EQ(nearest_name("ab", {"xy", "c"}), "") << "nothing in common";
  EXPECT_EQ(nearest_name("anything", {}), "");
}

}  // namespace
}  // namespace sidestep
