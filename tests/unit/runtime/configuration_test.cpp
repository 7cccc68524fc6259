#include <algorithm>
#include <ctime>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class ConfigurationFiles : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    return own_folder_.write(name, text);
  }

  ConfigurationReading read(const std::filesystem::path& file,
                            const std::vector<std::string>& overrides = {}) {
    return read_configuration(file, overrides, YamlDocumentReader());
  }

  /// The errors of a reading without the folder's name.
  std::vector<std::string> errors(const ConfigurationReading& reading) {
    std::vector<std::string> texts;
    for (const Error& error : reading.errors) {
      std::string text = error.describe();
      const std::string prefix = folder_.string() + "/";
      for (std::size_t at; (at = text.find(prefix)) != std::string::npos;) {
        text.erase(at, prefix.size());
      }
      texts.push_back(text);
    }
    return texts;
  }

  static std::string value(const Node& root, std::string_view block, std::string_view key) {
    const Node* node = root.find(block);
    node = node != nullptr ? node->find(key) : nullptr;
    return node != nullptr ? node->text() : "(none)";
  }

  testing_support::TemporaryFolder own_folder_;
  std::filesystem::path folder_ = own_folder_.path();
};

TEST_F(ConfigurationFiles, OverridesGoOverTheFileAndTheFileOverItsBases) {
  write("parts/a.yaml", "schema_version: 1\nmapper: {plugin: m, x: 1, y: 1, z: 1}\n");
  write("parts/b.yaml", "mapper: {x: 2, y: 2}\n");
  const auto file = write("c.yaml", "base: [parts/a.yaml, parts/b.yaml]\nmapper: {y: 3}\n");
  const auto reading = read(file, {"mapper.w=4"});
  EXPECT_THAT(errors(reading), ElementsAre());
  const Node& root = reading.configuration.root;
  EXPECT_EQ(value(root, "mapper", "z"), "1");
  EXPECT_EQ(value(root, "mapper", "x"), "2");
  EXPECT_EQ(value(root, "mapper", "y"), "3");
  EXPECT_EQ(value(root, "mapper", "w"), "4");
  EXPECT_EQ(root.find("base"), nullptr);
  EXPECT_EQ(root.find("mapper")->find("x")->mark().file, (folder_ / "parts/b.yaml").string());
  EXPECT_EQ(root.find("mapper")->find("w")->mark().to_string(), "--set mapper.w=4");
  EXPECT_EQ(reading.configuration.name, "c");
}

TEST_F(ConfigurationFiles, AnotherPluginStartsAfresh) {
  write("a.yaml", "schema_version: 1\nfield: {plugin: edt, signed: true}\n");
  const auto file = write("b.yaml", "base: a.yaml\nfield: {plugin: other, size: 2}\n");
  EXPECT_EQ(value(read(file).configuration.root, "field", "signed"), "(none)");
  const auto set = read(folder_ / "a.yaml", {"field.plugin=third"});
  EXPECT_EQ(value(set.configuration.root, "field", "plugin"), "third");
  EXPECT_EQ(value(set.configuration.root, "field", "signed"), "(none)");
  const auto same = read(folder_ / "a.yaml", {"field.plugin=edt"});
  EXPECT_EQ(value(same.configuration.root, "field", "signed"), "true");
}

TEST_F(ConfigurationFiles, TheOrderOfOverridesDoesNotDropThoseOfTheNewPlugin) {
  const auto file = write("a.yaml", "schema_version: 1\nfield: {plugin: edt, signed: true}\n");
  for (const std::vector<std::string>& overrides :
       {std::vector<std::string>{"field.size=2", "field.plugin=other"},
        std::vector<std::string>{"field.plugin=other", "field.size=2"}}) {
    const Node root = read(file, overrides).configuration.root;
    EXPECT_EQ(value(root, "field", "plugin"), "other");
    EXPECT_EQ(value(root, "field", "size"), "2");
    EXPECT_EQ(value(root, "field", "signed"), "(none)");
  }
}

TEST_F(ConfigurationFiles, ABaseCannotBeSetFromTheCommandLine) {
  write("b.yaml", "robot: {plugin: point}\n");
  const auto file = write("a.yaml", "schema_version: 1\n");
  EXPECT_THAT(errors(read(file, {"base=b.yaml"})),
              ElementsAre(HasSubstr("--set base=b.yaml: 'base' cannot be set")));
  EXPECT_THAT(errors(read(file, {"base.0=b.yaml"})),
              ElementsAre(HasSubstr("'base' cannot be set")));
}

TEST_F(ConfigurationFiles, ANameThatNoFileCanHaveIsAnError) {
  const std::string name(5000, 'x');
  const auto file = write("a.yaml", "schema_version: 1\nbase: " + name + "\n");
  EXPECT_THAT(errors(read(file)), ElementsAre(HasSubstr("a.yaml:2:7: the base cannot be read")));
  EXPECT_EQ(read(folder_ / name).errors.size(), 1u);
}

TEST_F(ConfigurationFiles, BasesThatDoubleAtEachLevelEnd) {
  for (int i = 0; i < 40; ++i) {
    const std::string next = "level_" + std::to_string(i + 1) + ".yaml";
    write("level_" + std::to_string(i) + ".yaml", "base: [" + next + ", " + next + "]\n");
  }
  write("level_40.yaml", "robot: {plugin: point}\n");
  const auto file = write("a.yaml", "schema_version: 1\nbase: level_0.yaml\n");
  EXPECT_THAT(errors(read(file)),
              ElementsAre(HasSubstr("more than 200 files are named as bases, and bases of bases")));
}

/// Two documents of as many keys, all others'.
class ManyKeys final : public DocumentReader {
 public:
  explicit ManyKeys(int count) : count_(count) {}
  [[nodiscard]] Result<Node> read_leniently(const std::filesystem::path& file,
                                            std::vector<Error>&) const override {
    const std::string stem = file.stem().string();
    const SourceMark mark{file.string(), 1, 1};
    Node::Map map;
    if (stem == "top") map.push_back({"base", mark, Node(Node::Scalar{"under.yaml", false}, mark)});
    for (int i = 0; i < count_; ++i) {
      map.push_back({stem + std::to_string(i), mark, Node(Node::Scalar{"1", false}, mark)});
    }
    return Node(std::move(map), mark);
  }

 private:
  int count_;
};

/// 16 times as many keys take 16 times as long; where each were looked for among all, 256 times.
TEST(Configuration, ManyKeysAreMergedInTheTimeOfTheirNumber) {
  const auto seconds_of = [](int count) {
    double least_s = 1e9;
    for (int round = 0; round < 3; ++round) {
      const std::clock_t begin = std::clock();
      const auto reading = read_configuration("top.yaml", {}, ManyKeys(count));
      least_s = std::min(least_s, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
      EXPECT_EQ(reading.configuration.root.entries().size(), std::size_t{2} * idx(count));
    }
    return least_s;
  };
  const double few_s = seconds_of(2500), many_s = seconds_of(40000);
  EXPECT_LT(many_s, 80.0 * few_s);
}

TEST_F(ConfigurationFiles, ABaseIsARegularFileOfBoundedSize) {
  EXPECT_THAT(errors(read(write("a.yaml", "schema_version: 1\nbase: /dev/zero\n"))),
              ElementsAre(HasSubstr("this is a pipe or a device, not a file")));
  write("large.yaml", std::string(9 << 20, ' '));
  EXPECT_THAT(errors(read(write("b.yaml", "schema_version: 1\nbase: large.yaml\n"))),
              ElementsAre(HasSubstr("the file has 9 MiB; 8 MiB at most are read")));
}

TEST_F(ConfigurationFiles, PluginPathsAreAListOfPaths) {
  EXPECT_THAT(errors(read(write("a.yaml", "schema_version: 1\nplugin_paths: /opt/plugins\n"))),
              ElementsAre("a.yaml:2:15: 'plugin_paths': expected a list of paths, found a string"));
  EXPECT_THAT(errors(read(write("b.yaml", "schema_version: 1\nplugin_paths: [a, [b], ]\n"))),
              ElementsAre("b.yaml:2:19: 'plugin_paths[1]': expected a path, found a list"));
  EXPECT_THAT(errors(read(write("c.yaml", "schema_version: 1\nplugin_paths: [a, /b]\n"))),
              ElementsAre());
}

TEST_F(ConfigurationFiles, OverridesReachIntoListsAndMakeNewBlocks) {
  const auto file =
      write("a.yaml", "schema_version: 1\nexperiment: {plans: [{name: a}, {name: b}]}\n");
  const auto reading =
      read(file, {"experiment.plans.1.name=c", "planning.unknown=free", "check={margin_m: 0.1}"});
  EXPECT_THAT(errors(reading), ElementsAre());
  const Node& root = reading.configuration.root;
  EXPECT_EQ(root.find("experiment")->find("plans")->items()[1].find("name")->text(), "c");
  EXPECT_EQ(value(root, "planning", "unknown"), "free");
  EXPECT_EQ(value(root, "check", "margin_m"), "0.1");
}

TEST_F(ConfigurationFiles, AllMistakesAreReportedInOnePass) {
  write("parts/b.yaml", "robot: {}\nrobot: {}\n");
  const auto file = write("a.yaml", "base: [parts/b.yaml, parts/gone.yaml]\nmaper: {}\n");
  EXPECT_THAT(
      errors(read(file, {"mapper", "robot.plans.0=1", "=1", "a..b=1", "check=[1"})),
      ElementsAre("parts/b.yaml:2:1: the key 'robot' appears twice (first at parts/b.yaml:1:1)",
                  "a.yaml:1:22: the base cannot be read\n  because parts/gone.yaml: there is no "
                  "such file",
                  "--set mapper: expected key.key=value", "--set =1: expected key.key=value",
                  "--set a..b=1: expected key.key=value", HasSubstr("--set check=[1: not valid"),
                  "a.yaml:2:1: unknown key 'maper' (did you mean 'mapper'?)",
                  "a.yaml:1:1: 'schema_version' is missing (this version reads schema_version: "
                  "1)"));
}

TEST_F(ConfigurationFiles, ABaseCanBeLeftOut) {
  write("far.yaml", "mapper: {max_range_m: 9.0}\n");
  write("near.yaml", "base: far.yaml\nmapper: {resolution_m: 0.05}\n");
  write("a.yaml", "schema_version: 1\nbase: near.yaml\n");
  const auto whole = read(folder_ / "a.yaml");
  EXPECT_NE(whole.configuration.root.find("mapper")->find("max_range_m"), nullptr);
  write("b.yaml", "base: a.yaml\nwithout: [far]\n");
  for (const auto& reading :
       {read(folder_ / "b.yaml"), read(folder_ / "a.yaml", {"without=far"})}) {
    ASSERT_TRUE(reading.errors.empty()) << reading.errors.front().describe();
    const Node& root = reading.configuration.root;
    EXPECT_EQ(root.find("mapper")->find("max_range_m"), nullptr);
    EXPECT_NE(root.find("mapper")->find("resolution_m"), nullptr);
    EXPECT_EQ(root.find("without"), nullptr);
  }
  const auto found = errors(read(folder_ / "a.yaml", {"without=[fra]"}));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0],
            "--set without=[fra]: 'without': no base is called 'fra' (did you mean 'far'?)");
}

TEST_F(ConfigurationFiles, ACycleOfBasesIsAnError) {
  write("a.yaml", "schema_version: 1\nbase: b.yaml\n");
  write("b.yaml", "base: a.yaml\n");
  const auto found = errors(read(folder_ / "a.yaml"));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0], "b.yaml:1:7: 'a.yaml' is its own base");
}

TEST_F(ConfigurationFiles, AnUnknownSchemaVersionIsAnError) {
  const auto file = write("a.yaml", "schema_version: 2\n");
  EXPECT_THAT(errors(read(file)),
              ElementsAre("a.yaml:1:17: schema_version 2 is not known (this version reads "
                          "schema_version: 1)"));
}

struct Part {
  double radius_m = 0.5;
  static Parameters<Part> parameters() {
    return Parameters<Part>().add("radius_m", &Part::radius_m, "Radius.",
                                  {.unit = "m", .min = 0.0, .max = 1.0});
  }
};

struct Everything {
  bool flag = false;
  int count = 3;
  double length_m = 0.25;
  std::string mode = "fast";
  std::vector<double> weights = {1.0, 2.0};
  Eigen::Vector3i size{1, 2, 3};
  std::optional<double> limit;
  std::optional<Part> spare;
  Part part;
  std::vector<Part> parts;
  std::string name;

  static Parameters<Everything> parameters() {
    using E = Everything;
    return Parameters<E>()
        .add("flag", &E::flag, "A flag.")
        .add("count", &E::count, "A count.", {.min = 1})
        .add("length_m", &E::length_m, "A length.", {.unit = "m", .max = 2.0})
        .add("mode", &E::mode, "A mode.", {.choices = {"fast", "exact"}})
        .add("weights", &E::weights, "Weights.")
        .add("size", &E::size, "A size.")
        .add("limit", &E::limit, "A limit.")
        .add("part", &E::part, "A part.")
        .add("spare", &E::spare, "Another part, or none.")
        .add("parts", &E::parts, "Parts.")
        .add("name", &E::name, "A name.", {.required = true});
  }
};

Node parse(const std::string& text) {
  std::vector<Error> errors;
  return parse_yaml(text, "t.yaml", errors).value();
}

std::vector<std::string> mistakes(const std::string& text) {
  std::vector<Error> errors;
  check_against_schema(parse(text), Everything::parameters().schema(), {"plugin"}, errors);
  std::vector<std::string> texts;
  for (const Error& error : errors) texts.push_back(error.describe());
  return texts;
}

TEST(SchemaCheck, AcceptsWhatIsDeclared) {
  EXPECT_THAT(mistakes("{plugin: x, name: n, flag: true, count: 1, length_m: 2, mode: exact, "
                       "weights: [], size: [1, 2, 3], limit: 3, part: {radius_m: 1}, "
                       "parts: [{}, {radius_m: 0}]}"),
              ElementsAre());
}

TEST(SchemaCheck, FindsEveryMistakeAtEveryDepth) {
  EXPECT_THAT(
      mistakes("flag: 1\ncount: 0\nlength_m: .nan\nmode: fats\nweights: [1, x]\nsize: [1, 2]\n"
               "limit: a\npart: {radius: 1}\nparts: [{radius_m: 2}]\n"),
      ElementsAre(
          "t.yaml:1:7: 'flag': expected true or false, found a number '1'",
          "t.yaml:2:8: 'count': 0 is out of range (expected at least 1)",
          "t.yaml:3:11: 'length_m': expected a finite number, found '.nan'",
          "t.yaml:4:7: 'mode': 'fats' is not one of fast, exact (did you mean 'fast'?)",
          "t.yaml:5:14: 'weights[1]': expected a number, found a string 'x'",
          "t.yaml:6:7: 'size': expected a list of 3, found 2",
          "t.yaml:7:8: 'limit': expected a number, found a string 'a'",
          "t.yaml:8:8: unknown key 'part.radius' (did you mean 'radius_m'?)",
          "t.yaml:9:20: 'parts[0].radius_m': 2 is out of range (expected between 0 and 1 m)",
          "t.yaml:1:1: 'name' is missing (A name.)"));
}

TEST(SchemaCheck, AnItemOfAListCannotBeLeftOpen) {
  EXPECT_THAT(mistakes("name: n\nweights: [1, ~]\nsize:\n  - 1\n  -\n  - 3\nparts: [~]\n"),
              ElementsAre(HasSubstr("'weights[1]': expected a number, found nothing"),
                          HasSubstr("'size[1]': expected a whole number, found nothing"),
                          HasSubstr("'parts[0]': expected a map, found nothing")));
}

TEST(SchemaCheck, DefaultsAreThoseOfTheStruct) {
  conformance::RecordingLog log;
  const conformance::StoppedClock clock;
  const conformance::NoDocuments documents;
  WorkerPool workers(1);
  Host host({}, log, clock, workers, documents);
  const Node filled =
      host.with_defaults(parse("{name: n, parts: [{}]}"), Everything::parameters().schema());
  Everything read;
  read.count = 99;
  read.weights.clear();
  std::vector<Error> errors;
  Everything::parameters().read(filled, read, errors);
  EXPECT_TRUE(errors.empty());
  const Everything defaults;
  EXPECT_EQ(read.count, defaults.count);
  EXPECT_EQ(read.weights, defaults.weights);
  EXPECT_EQ(read.size, defaults.size);
  EXPECT_EQ(read.mode, defaults.mode);
  ASSERT_EQ(read.parts.size(), 1u);
  EXPECT_EQ(read.parts[0].radius_m, 0.5);
  EXPECT_EQ(filled.find("length_m")->mark().to_string(), "default");
  EXPECT_FALSE(read.spare);
  errors.clear();
  check_against_schema(filled, Everything::parameters().schema(), {}, errors);
  EXPECT_TRUE(errors.empty());
}

}  // namespace
}  // namespace sidestep
