#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/reference.hpp>

namespace sidestep {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

struct Piece {
  double radius_m = 0.5;
  static Parameters<Piece> parameters() {
    return Parameters<Piece>().add("radius_m", &Piece::radius_m, "Radius.",
                                   {.unit = "m", .min = 0.0});
  }
};

struct Options {
  double length_m = 0.8;
  std::string mode = "a|b";
  Eigen::Vector3i size_vox{1, 2, 3};
  std::vector<Piece> parts;
  std::string name;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("length_m", &O::length_m, "A length.", {.unit = "m", .min = 0.0, .max = 2.0})
        .add("mode", &O::mode, "This | that.", {.choices = {"a|b", "c"}})
        .add("size_vox", &O::size_vox, "A size.", {.min = 1})
        .add("parts", &O::parts, "Parts.")
        .add("name", &O::name, "A name.", {.required = true});
  }
};

PluginInfo plugin(std::string name) {
  return {
      PluginKind::kField, std::move(name), "1", "A field", {}, Options::parameters().schema(), {}};
}

TEST(Reference, SummaryNamesTypeUnitRangeAndDefault) {
  const Schema schema = Options::parameters().schema();
  EXPECT_EQ(parameter_summary(schema[0]), "number [m], 0 to 2, default 0.8");
  EXPECT_EQ(parameter_summary(schema[2]),
            "list of integers, 3 values, at least 1, "
            "default [1, 2, 3]");
  EXPECT_EQ(parameter_summary(schema[4]), "string, required");
}

TEST(Reference, MarkdownHasARowForEveryParameterAtEveryDepth) {
  const std::string page = reference_markdown(
      {plugin("edt")}, {{"planning", "How.", Options::parameters().schema(), ""}});
  EXPECT_THAT(page, HasSubstr("## planning\n\nHow."));
  EXPECT_THAT(page, HasSubstr("## field: edt"));
  for (const char* name : {"length_m", "mode", "size_vox", "parts", "parts[].radius_m", "name"}) {
    EXPECT_THAT(page, HasSubstr("| `" + std::string(name) + "` |"));
  }
  EXPECT_THAT(page, HasSubstr("This \\| that.")) << "a bar would end the table's cell";
}

TEST(Reference, JsonSchemaStatesWhatIsChecked) {
  const Json schema = Json::parse(configuration_json_schema({plugin("edt"), plugin("esdf")}, {}));
  const Json& blocks = schema["properties"]["field"]["anyOf"];
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(blocks[1]["properties"]["plugin"]["const"], "esdf");
  EXPECT_EQ(blocks[0]["additionalProperties"], false);
  const Json& properties = blocks[0]["properties"];
  EXPECT_EQ(properties["length_m"]["minimum"], 0.0);
  EXPECT_EQ(properties["length_m"]["maximum"], 2.0);
  EXPECT_EQ(properties["mode"]["enum"], (Json{"a|b", "c"}));
  EXPECT_EQ(properties["size_vox"]["minItems"], 3);
  EXPECT_EQ(properties["size_vox"]["items"]["type"], "integer");
  EXPECT_EQ(properties["parts"]["items"]["properties"]["radius_m"]["type"], "number");
}

TEST(Reference, JsonSchemaLetsAFileWithABaseLeaveThingsOut) {
  const Json schema = Json::parse(configuration_json_schema(
      {plugin("edt")}, {{"experiment", "What", Options::parameters().schema(), "plan"}}));
  EXPECT_EQ(schema["properties"]["experiment"]["anyOf"][0]["properties"]["type"]["const"], "plan");
  EXPECT_FALSE(schema["properties"]["field"]["anyOf"][0].contains("required"));
}

}  // namespace
}  // namespace sidestep
