#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

struct Inner {
  int count = 2;
  static Parameters<Inner> parameters() {
    return Parameters<Inner>().add("count", &Inner::count, "Count.");
  }
};

struct Options {
  bool flag = true;
  int count = -3;
  std::int64_t large = 1;
  double length_m = 0.1;
  std::string word = "free";
  std::string nothing;
  std::filesystem::path file = "a/b.yaml";
  std::vector<std::string> words = {"a", "b"};
  Eigen::Vector3d position_m{0.5, -1.0, 2.0};
  std::optional<double> limit;
  Inner inner;
  std::vector<Inner> inners;
  Node anything;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("flag", &O::flag, "Flag.")
        .add("count", &O::count, "Count.", {.required = true})
        .add("large", &O::large, "Large.")
        .add("length_m", &O::length_m, "Length.", {.unit = "m", .min = 0.0})
        .add("word", &O::word, "Word.", {.choices = {"free", "occupied"}})
        .add("nothing", &O::nothing, "Nothing.")
        .add("file", &O::file, "File.")
        .add("words", &O::words, "Words.")
        .add("position_m", &O::position_m, "Position.")
        .add("limit", &O::limit, "Limit.")
        .add("inner", &O::inner, "Inner.")
        .add("inners", &O::inners, "Inners.")
        .add("anything", &O::anything, "Anything.");
  }
};

const Parameter& parameter(const Schema& schema, std::string_view name) {
  return *std::ranges::find(schema, name, &Parameter::name);
}

TEST(Parameters, DeclareTypesUnitsAndDefaultsOfTheMembers) {
  const Schema schema = Options::parameters().schema();
  ASSERT_EQ(schema.size(), 13u);
  EXPECT_EQ(parameter(schema, "flag").type, ParameterType::kBool);
  EXPECT_EQ(parameter(schema, "flag").default_text, "true");
  EXPECT_TRUE(parameter(schema, "count").required);
  EXPECT_EQ(parameter(schema, "count").default_text, "") << "what is required has no default";
  EXPECT_EQ(parameter(schema, "length_m").default_text, "0.1");
  EXPECT_EQ(parameter(schema, "length_m").unit, "m");
  EXPECT_EQ(parameter(schema, "word").type, ParameterType::kChoice);
  EXPECT_EQ(parameter(schema, "nothing").default_text, "\"\"");
  EXPECT_EQ(parameter(schema, "file").type, ParameterType::kPath);
  EXPECT_EQ(parameter(schema, "words").default_text, "[a, b]");
  EXPECT_EQ(parameter(schema, "position_m").type, ParameterType::kDoubles);
  EXPECT_EQ(parameter(schema, "position_m").size, 3u);
  EXPECT_EQ(parameter(schema, "limit").type, ParameterType::kDouble);
  EXPECT_EQ(parameter(schema, "limit").default_text, "null");
  EXPECT_EQ(parameter(schema, "inner").parameters.front().name, "count");
  EXPECT_EQ(parameter(schema, "inners").type, ParameterType::kObjects);
  EXPECT_EQ(parameter(schema, "anything").type, ParameterType::kNode);
}

std::vector<Error> read(const std::string& yaml, Options& into) {
  std::vector<Error> errors;
  const Node map = parse_yaml(yaml, "dir/t.yaml", errors).value();
  Options::parameters().read(map, into, errors);
  return errors;
}

TEST(Parameters, ReadEveryType) {
  Options options;
  EXPECT_TRUE(read("{flag: false, count: 7, large: 9000000000, length_m: 2, word: occupied, "
                   "nothing: x, file: c.yaml, words: [z], position_m: [1, 2, 3], limit: 4, "
                   "inner: {count: 5}, inners: [{count: 6}, {}], anything: {k: [1]}}",
                   options)
                  .empty());
  EXPECT_FALSE(options.flag);
  EXPECT_EQ(options.count, 7);
  EXPECT_EQ(options.large, 9000000000);
  EXPECT_EQ(options.length_m, 2.0);
  EXPECT_EQ(options.word, "occupied");
  EXPECT_EQ(options.nothing, "x");
  EXPECT_EQ(options.file, "dir/c.yaml");
  EXPECT_EQ(options.words, std::vector<std::string>{"z"});
  EXPECT_EQ(options.position_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(options.limit, 4.0);
  EXPECT_EQ(options.inner.count, 5);
  ASSERT_EQ(options.inners.size(), 2u);
  EXPECT_EQ(options.inners[1].count, 2) << "each item starts from its own defaults";
  EXPECT_EQ(options.anything.find("k")->items().size(), 1u);
}

TEST(Parameters, WhatIsAbsentOrNullKeepsItsDefault) {
  Options options;
  EXPECT_TRUE(read("{length_m: ~, position_m: }", options).empty());
  EXPECT_EQ(options.length_m, 0.1);
  EXPECT_EQ(options.position_m, Eigen::Vector3d(0.5, -1.0, 2.0));
}

TEST(Parameters, ANumberThatDoesNotFitIsAnError) {
  Options options;
  const auto errors = read("count: 3000000000\n", options);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].describe(), "dir/t.yaml:1:8: the number is too large");
  EXPECT_EQ(options.count, -3);
}

struct WithOptionalGroups {
  std::optional<Inner> group;
  std::optional<Eigen::Vector3d> corner_m;
  static Parameters<WithOptionalGroups> parameters() {
    using O = WithOptionalGroups;
    return Parameters<O>()
        .add("group", &O::group, "Group.")
        .add("corner_m", &O::corner_m, "Corner.");
  }
};

TEST(Parameters, AnOptionalGroupIsCheckedAsAnyOtherAndMayBeAbsent) {
  const Schema schema = WithOptionalGroups::parameters().schema();
  EXPECT_EQ(parameter(schema, "group").type, ParameterType::kObject);
  EXPECT_EQ(parameter(schema, "group").default_text, "null");
  EXPECT_EQ(parameter(schema, "corner_m").size, 3u);
  const auto read_checked = [&](const std::string& yaml, std::vector<Error>& errors) {
    const Node map = parse_yaml(yaml, "t.yaml", errors).value();
    check_against_schema(map, schema, {}, errors);
    WithOptionalGroups options;
    if (errors.empty()) WithOptionalGroups::parameters().read(map, options, errors);
    return options;
  };
  std::vector<Error> errors;
  EXPECT_FALSE(read_checked("{}", errors).group);
  const auto options = read_checked("{group: {}, corner_m: [1, 2, 3]}", errors);
  ASSERT_TRUE(options.group);
  EXPECT_EQ(options.group->count, 2) << "a group that is named starts from its defaults";
  EXPECT_EQ(options.corner_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(errors.empty());
  (void)read_checked("{group: {cuont: 3}, corner_m: [1, 2]}", errors);
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].describe(), "t.yaml:1:10: unknown key 'group.cuont' (did you mean 'count'?)");
}

TEST(OptionMistakes, AreReportedWhereTheFirstParameterThatIsWrittenStands) {
  std::vector<Error> errors;
  const Node map =
      parse_yaml("low: 1\nlist:\n  - {a: {b: [7, 8]}}\n  - 2\n", "t.yaml", errors).value();
  report_mistakes(map,
                  {{{"low"}, "is low", "raise it"},
                   {{"high", "low"}, "is not written", {}},
                   {{"list[0].a.b[1]"}, "is deep", {}},
                   {{"list[0].a.c"}, "is where its group is", {}},
                   {{"list[5]"}, "is where its list is", {}},
                   {{"high"}, "is where the block is", {}},
                   {{}, "nothing is right", {}}},
                  errors);
  std::vector<std::string> texts;
  for (const Error& error : errors) {
    EXPECT_EQ(error.code, ErrorCode::kConfig);
    texts.push_back(error.describe());
  }
  EXPECT_THAT(texts, testing::ElementsAre("t.yaml:1:6: 'low' is low (raise it)",
                                          "t.yaml:1:6: 'high' is not written",
                                          "t.yaml:3:17: 'list[0].a.b[1]' is deep",
                                          "t.yaml:3:9: 'list[0].a.c' is where its group is",
                                          "t.yaml:3:3: 'list[5]' is where its list is",
                                          "t.yaml:1:1: 'high' is where the block is",
                                          "t.yaml:1:1: nothing is right"));
}

TEST(NumberText, ReadsBackAsTheSameNumber) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> exponent(-300.0, 300.0);
  for (int i = 0; i < 1000; ++i) {
    const double value = std::pow(10.0, exponent(random)) * (i % 2 == 0 ? 1.0 : -1.0);
    EXPECT_EQ(std::stod(detail::number_text(value)), value);
  }
  EXPECT_EQ(detail::number_text(0.1), "0.1") << "the shortest such text";
  EXPECT_EQ(detail::number_text(3.0), "3");
}

TEST(AbiStamp, DescribesThisBinary) {
  const AbiStamp stamp = abi_stamp();
  EXPECT_EQ(stamp.cplusplus, __cplusplus);
  EXPECT_EQ(stamp.eigen_max_align_bytes, static_cast<std::uint32_t>(EIGEN_MAX_ALIGN_BYTES));
  EXPECT_EQ(stamp.libstdcxx_cxx11_abi, 1u);
  EXPECT_EQ(std::string(stamp.compiler_abi), "itanium-" + std::to_string(__GXX_ABI_VERSION));
  EXPECT_EQ(sizeof(AbiStamp), 88u) << "the prefix of a descriptor never changes its layout";
  EXPECT_EQ(offsetof(PluginDescriptor, abi), 16u);
  EXPECT_EQ(offsetof(PluginDescriptor, magic), 4u);
}

}  // namespace
}  // namespace sidestep
