#include <fstream>

#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

Node parse_or_fail(const std::string& text) {
  std::vector<Error> errors;
  auto node = parse_yaml(text, "t.yaml", errors);
  EXPECT_TRUE(node) << node.error().describe();
  EXPECT_TRUE(errors.empty());
  return node.value_or(Node{});
}

std::string error_of(const std::string& text) {
  std::vector<Error> errors;
  const auto node = parse_yaml(text, "t.yaml", errors);
  if (!node) return node.error().describe();
  return errors.empty() ? "no error" : errors.front().describe();
}

TEST(YamlDocument, KeepsPositionsOrderAndQuoting) {
  const Node root = parse_or_fail("b: 1\na:\n  - x\n  - \"2\"\n");
  ASSERT_EQ(root.entries().size(), 2u);
  EXPECT_EQ(root.entries()[0].key, "b");
  const Node& second = root.find("a")->items()[1];
  EXPECT_EQ(second.mark().to_string(), "t.yaml:4:5");
  EXPECT_EQ(second.kind(), "a string");
  EXPECT_EQ(root.find("b")->kind(), "a number");
}

TEST(YamlDocument, AnchorsAndNullsWork) {
  const Node root = parse_or_fail("a: &x {k: 1}\nb: *x\nc:\nd: ~\n");
  EXPECT_EQ(root.find("b")->find("k")->text(), "1");
  EXPECT_TRUE(root.find("c")->is_null());
  EXPECT_TRUE(root.find("d")->is_null());
  EXPECT_TRUE(parse_or_fail("").is_null());
}

TEST(YamlDocument, MistakesHavePositions) {
  EXPECT_EQ(error_of("a: 1\nb: 2\na: 3\n"),
            "t.yaml:3:1: the key 'a' appears twice (first at t.yaml:1:1)");
  EXPECT_TRUE(error_of("a: [1, 2\nb: 3\n").starts_with("t.yaml:2:"));
  EXPECT_NE(error_of("a: !!python/object x\n").find("is not supported"), std::string::npos);
  EXPECT_NE(error_of("a: 1\n---\nb: 2\n").find("more than one document"), std::string::npos);
  // yaml-cpp's LoadAll() finds documents without end here.
  EXPECT_TRUE(error_of("[1, 2], 3\n").starts_with("t.yaml:1:7: more than one document"));
  EXPECT_NE(error_of("? [1, 2]\n: 3\n").find("a key must be"), std::string::npos);
}

/// Of a byte of 0 and the letter behind it, yaml-cpp leaves nothing.
TEST(YamlDocument, ControlCharactersAreNoText) {
  EXPECT_EQ(error_of("a: 1\n" + std::string(1, '\0') + "foo: 2\n"),
            "t.yaml:2:1: the byte 0 is no character of a text in UTF-8");
  EXPECT_EQ(error_of("a: 1\nb: 2\f3\n"),
            "t.yaml:2:5: the byte 12 is no character of a text in UTF-8");
  EXPECT_EQ(error_of("a: \"\x7f\"\n"),
            "t.yaml:1:5: the byte 127 is no character of a text in UTF-8");
  EXPECT_EQ(error_of("a:\t1\r\nb: \xc3\xa4\n"), "no error");
}

TEST(YamlDocument, FilesThatCannotBeRead) {
  const YamlDocumentReader reader;
  const auto missing = reader.read("/no/such/file.yaml");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  const auto folder = reader.read(testing::TempDir());
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().code, ErrorCode::kIo);
}

/// Every value of a document, however it is written, survives being written and read again.
void expect_same(const Node& a, const Node& b) {
  ASSERT_EQ(a.kind(), b.kind()) << a.text() << " / " << b.text();
  EXPECT_EQ(a.text(), b.text());
  ASSERT_EQ(a.items().size(), b.items().size());
  for (std::size_t i = 0; i < a.items().size(); ++i) expect_same(a.items()[i], b.items()[i]);
  ASSERT_EQ(a.entries().size(), b.entries().size());
  for (std::size_t i = 0; i < a.entries().size(); ++i) {
    EXPECT_EQ(a.entries()[i].key, b.entries()[i].key);
    expect_same(a.entries()[i].value, b.entries()[i].value);
  }
}

TEST(YamlDocument, WhatIsWrittenReadsBackTheSame) {
  const Node root = parse_or_fail(
      "a: {b: [1, 2.5, x, \"3\", \"true\"], c: \"with: colon # and \\\"quotes\\\"\"}\n"
      "list:\n  - {x: 1, y: []}\n  - [a, b]\n  - - nested\n    - {deep: true}\n"
      "empty: {}\nnothing:\ntext: \"two\\nlines\"\nblank: \"\"\n\"odd key: 1\": -7\n"
      "nulls: [\"null\", \"Null\", \"NULL\", \"~\"]\n"
      "control: \"a\\rb\\x01c\\u0085\\u2028d\\x7f\"\nutf8: \"\u00fcber\"\n");
  expect_same(root, parse_or_fail(to_yaml(root, false)));
  expect_same(root, parse_or_fail(to_yaml(root, true)));
}

TEST(YamlDocument, OriginsStandBesideEveryValueEvenInLists) {
  Node root = parse_or_fail("a: {b: 1}\nlist: [1, 2]\n");
  EXPECT_EQ(to_yaml(root, true), "a:\n  b: 1  # t.yaml:1:8\nlist: [1, 2]  # t.yaml:2:7\n");
  root.find("list")->items()[1] = Node(Node::Scalar{"3", false}, {"--set list.1=3", 0, 0});
  EXPECT_EQ(to_yaml(root, true),
            "a:\n  b: 1  # t.yaml:1:8\nlist:\n  - 1  # t.yaml:2:8\n  - 3  # --set list.1=3\n");
}

TEST(YamlDocument, AnOriginOfSeveralLinesStaysAComment) {
  Node root = parse_or_fail("a: 1\n");
  root.find("a")->set_mark({"--set a=\n  1", 0, 0});
  expect_same(root, parse_or_fail(to_yaml(root, true)));
}

TEST(YamlDocument, DocumentsThatGrowWithoutEndAreRefused) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 9; ++i) {
    const std::string below = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int j = 0; j < 10; ++j) bomb += (j == 0 ? "" : ", ") + below;
    bomb += "]\n";
  }
  EXPECT_NE(error_of(bomb).find("too large"), std::string::npos);
  EXPECT_NE(error_of("a: &x [*x, *x]\n").find("nested too deeply"), std::string::npos);
  EXPECT_NE(error_of("a: " + std::string(100000, '[')), "no error");
}

}  // namespace
}  // namespace sidestep
