#include <regex>

#include <gmock/gmock.h>

#include "robot_testing.hpp"
#include "urdf_file.hpp"
#include "urdf_outline.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;
using testing_robot::Loader;
using testing_robot::test_folder;
using testing_robot::write_file;

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The text with spaces for its comments, all else where it was.
std::string without_comments(std::string text) {
  for (std::size_t at = text.find("<!--"); at != std::string::npos; at = text.find("<!--", at)) {
    const std::size_t end = text.find("-->", at) + 3;
    for (; at < end; ++at) text[at] = text[at] == '\n' ? '\n' : ' ';
  }
  return text;
}

std::vector<std::filesystem::path> shipped_urdfs() {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(SIDESTEP_SOURCE_DIR "/robots")) {
    if (entry.is_directory()) files.push_back(entry.path() / "robot.urdf");
  }
  std::ranges::sort(files);
  return files;
}

/// What is wrong with a URDF, as one text.
std::string mistakes_in(const std::filesystem::path& file) {
  std::vector<Error> errors;
  const auto model = urdf_robot::read_urdf(file, errors);
  EXPECT_EQ(model.has_value(), errors.empty());
  return model ? std::string() : urdf_robot::all_of(std::move(errors), "the URDF").describe();
}

/// An attribute of numbers in a URDF's text.
struct Attribute {
  std::string element;
  std::string name;
  std::string value;
  std::size_t begin = 0;        ///< Of the attribute in the text.
  std::size_t value_begin = 0;  ///< Of its value.
  int line = 0;
  std::string joint_type;  ///< Of the joint around; empty in a link.

  [[nodiscard]] std::size_t end() const { return value_begin + value.size() + 1; }
  [[nodiscard]] std::string label() const {
    return element + " " + name + "=\"" + value + "\", line " + std::to_string(line);
  }
};

/// All of them, by regular expressions: of collisions' origins and geometries, and of joints.
std::vector<Attribute> numeric_attributes(const std::string& raw) {
  const std::string text = without_comments(raw);
  const std::regex part("<(link|joint)\\s[^>]*?(/>|>)");
  const std::regex element("<(origin|box|sphere|cylinder|mesh|axis|limit|mimic)\\s[^>]*>");
  const std::regex attribute("\\s([a-z]+)=\"([^\"]*)\"");
  const std::regex type("type=\"([a-z]+)\"");
  std::vector<Attribute> all;
  const auto end = std::sregex_iterator();
  for (std::sregex_iterator e(text.begin(), text.end(), element); e != end; ++e) {
    const auto element_at = static_cast<std::size_t>(e->position());
    Attribute one;
    one.element = (*e)[1];
    const std::string before = text.substr(0, element_at);
    std::smatch around;  // the part that began last
    for (std::sregex_iterator p(before.begin(), before.end(), part); p != end; ++p) around = *p;
    std::smatch kind;
    const std::string head = around[0];
    if (std::regex_search(head, kind, type)) one.joint_type = kind[1];
    const std::string tag = e->str();
    for (std::sregex_iterator a(tag.begin(), tag.end(), attribute); a != end; ++a) {
      one.name = (*a)[1];
      one.value = (*a)[2];
      if (one.name == "filename" || one.name == "joint") continue;
      one.begin = element_at + static_cast<std::size_t>(a->position(1));
      one.value_begin = element_at + static_cast<std::size_t>(a->position(2));
      one.line =
          1 + static_cast<int>(std::count(
                  text.begin(), text.begin() + static_cast<std::ptrdiff_t>(one.begin), '\n'));
      all.push_back(one);
    }
  }
  return all;
}

bool may_be_negative(const Attribute& one) {
  return one.element == "origin" || one.element == "axis" || one.element == "mimic" ||
         one.name == "lower" || one.name == "upper" || one.name == "scale";
}

bool may_be_missing(const Attribute& one) {
  if (one.element == "origin" || one.element == "mimic" || one.name == "scale") return true;
  if (one.name == "effort") return true;
  const bool is_end = one.name == "lower" || one.name == "upper";
  return one.element == "limit" &&
         (one.joint_type == "fixed" || (is_end && one.joint_type == "continuous"));
}

/// What else its value could have been written as, none of it readable.
std::vector<std::string> wrong_values(const Attribute& one) {
  const std::string& value = one.value;
  const std::size_t last = value.rfind(' ');
  const std::string but_last = last == std::string::npos ? "" : value.substr(0, last + 1);
  const std::string but_first = last == std::string::npos ? "" : value.substr(value.find(' '));
  std::vector<std::string> wrong{"",
                                 " ",
                                 but_last,                 // too few
                                 value + " 1",             // too many
                                 but_last + "0,25",        // a comma
                                 "one" + but_first,        // letters
                                 but_last + "0.3m",        // a unit
                                 "nan" + but_first,        //
                                 but_last + "inf",         //
                                 "-infinity" + but_first,  //
                                 but_last + "1e999",       //
                                 but_last + "0x10",        //
                                 but_last + "+-1",         //
                                 but_last + "1.2.3",       //
                                 but_last + "${length}"};
  if (!may_be_negative(one)) wrong.push_back(but_last + "-0.1");
  if (one.element == "box" || one.element == "sphere" || one.element == "cylinder" ||
      one.name == "scale") {
    wrong.push_back(but_last + "0");
  }
  return wrong;
}

class EveryUrdf : public ::testing::TestWithParam<std::filesystem::path> {};

TEST_P(EveryUrdf, IsRefusedWithTheLineOfWhateverNumberIsWrong) {
  const std::string text = read_text(GetParam());
  const auto file = test_folder() / "mutated.urdf";
  ASSERT_EQ(mistakes_in(write_file(file, text)), "");
  const auto attributes = numeric_attributes(text);
  ASSERT_FALSE(attributes.empty());
  for (const Attribute& one : attributes) {
    const std::string where = "mutated.urdf:" + std::to_string(one.line) + ":";
    for (const std::string& wrong : wrong_values(one)) {
      std::string mutated = text;
      mutated.replace(one.value_begin, one.value.size(), wrong);
      const std::string told = mistakes_in(write_file(file, mutated));
      ASSERT_THAT(told, HasSubstr(where)) << one.label() << " as \"" << wrong << '"';
      ASSERT_THAT(told, HasSubstr("<" + one.element + ">")) << one.label();
      ASSERT_THAT(told, HasSubstr(one.name)) << one.label();
    }
    std::string renamed = text;
    renamed.insert(one.begin + 1, 1, one.name[1] == 'z' ? 'y' : 'z');
    const std::string told = mistakes_in(write_file(file, renamed));
    ASSERT_THAT(told, HasSubstr(where)) << one.label() << " misspelt";
    ASSERT_THAT(told, HasSubstr("did you mean '" + one.name + "'?")) << one.label();
    std::string without = text;
    without.erase(one.begin, one.end() - one.begin);
    const std::string missed = mistakes_in(write_file(file, without));
    if (may_be_missing(one)) {
      ASSERT_EQ(missed, "") << one.label() << " left out";
    } else {
      ASSERT_THAT(missed, HasSubstr(where)) << one.label() << " left out";
      ASSERT_THAT(missed, HasSubstr("'" + one.name + "'")) << one.label();
    }
  }
  std::printf("%zu attributes of %s\n", attributes.size(), GetParam().c_str());
}

/// Every tag of what is read, with a capital or a letter less.
TEST_P(EveryUrdf, IsRefusedWithTheLineOfWhateverElementIsMisspelt) {
  const std::string text = read_text(GetParam());
  const std::string blank = without_comments(text);
  const auto file = test_folder() / "mutated.urdf";
  const std::regex element(
      "<(/?)(collision|geometry|box|sphere|cylinder|origin|axis|limit|mimic|link|joint)"
      "(?=[\\s/>])");
  const auto end = std::sregex_iterator();
  std::size_t count = 0;
  for (std::sregex_iterator e(blank.begin(), blank.end(), element); e != end; ++e) {
    const auto at = static_cast<std::size_t>(e->position(2));
    if (e->length(1) > 0) continue;  // its end is changed with its beginning
    const std::string name = (*e)[2];
    const std::size_t line = 1 + static_cast<std::size_t>(std::count(
                                     blank.begin(), blank.begin() + e->position(), '\n'));
    const std::size_t tag_end = blank.find('>', at);
    const bool is_single = blank[tag_end - 1] == '/';
    const std::size_t close = is_single ? std::string::npos : blank.find("</" + name + ">", at);
    const std::string capital(1, static_cast<char>(name[0] - 'a' + 'A'));
    for (const std::string& misspelt :
         {capital + name.substr(1), name.substr(0, 1) + name.substr(2)}) {
      std::string mutated = blank;
      if (close != std::string::npos) mutated.replace(close + 2, name.size(), misspelt);
      mutated.replace(at, name.size(), misspelt);
      const std::string told = mistakes_in(write_file(file, mutated));
      ASSERT_THAT(told, HasSubstr("mutated.urdf:" + std::to_string(line) + ":")) << misspelt;
      ASSERT_THAT(told, HasSubstr("<" + misspelt + ">"));
    }
    ++count;
  }
  EXPECT_GT(count, 5u);
}

INSTANTIATE_TEST_SUITE_P(Shipped, EveryUrdf, ::testing::ValuesIn(shipped_urdfs()),
                         [](const auto& test) {
                           return test.param.parent_path().filename().string();
                         });

/// A robot of one joint; `collision` and `joint` stand on lines 3 and 6.
std::string robot_with(const std::string& collision, const std::string& joint = "") {
  return "<robot name=\"r\">\n<link name=\"tray\">\n" + collision +
         "\n</link>\n<link name=\"base\"><collision><geometry><sphere radius=\"0.1\"/></geometry>"
         "</collision></link>\n<joint name=\"j\" type=\"revolute\"><parent link=\"base\"/><child "
         "link=\"tray\"/>" +
         joint + "<limit lower=\"-1\" upper=\"1\" velocity=\"2\"/></joint>\n</robot>\n";
}

std::string shape(const std::string& geometry) {
  return "<collision><geometry>" + geometry + "</geometry></collision>";
}

struct Refusal {
  std::string text;
  std::string told;
};

TEST(UrdfRules, SayWhereWhatAndWhatWasExpected) {
  const std::string box = "<box size=\"1 1 1\"/>";
  const std::vector<Refusal> refusals = {
      {robot_with(shape("<box size=\"0.3 0.9\"/>")),
       "bad.urdf:3:27: <box> of link 'tray' has size=\"0.3 0.9\", expected 3 numbers above 0"},
      {robot_with(shape("<cylinder radius=\"0,25\" length=\"0.19\"/>")),
       "bad.urdf:3:32: <cylinder> of link 'tray' has radius=\"0,25\", expected a number above 0 "
       "(decimals have a point, and spaces stand between numbers)"},
      {robot_with(shape("<cylinder radius=\"0.25\" lenght=\"0.19\"/>")),
       "bad.urdf:3:46: <cylinder> of link 'tray' has the attribute 'lenght', which URDF does not "
       "know (did you mean 'length'?)"},
      {robot_with(shape("<box/>")),
       "bad.urdf:3:22: <box> of link 'tray' needs the attribute 'size': 3 numbers above 0"},
      {robot_with(shape("<mesh filename=\"\"/>")),
       "bad.urdf:3:28: <mesh> of link 'tray' has filename=\"\", expected a name"},
      {robot_with(shape("<mesh filename=\"a.stl\" scale=\"1 1 0\"/>")),
       "bad.urdf:3:45: <mesh> of link 'tray' has scale=\"1 1 0\", expected 3 numbers other than 0"},
      {robot_with(shape(box + box)), "bad.urdf:3:41: link 'tray' has a <geometry> of several"},
      {robot_with("<collision><geometry>" + box + "</geometry><geometry>" + box +
                  "</geometry></collision>"),
       "bad.urdf:3:52: a second <geometry> in a <collision> (link 'tray')"},
      {robot_with("<collision><orgin xyz=\"0 0 1\"/><geometry>" + box + "</geometry></collision>"),
       "bad.urdf:3:12: URDF has no <orgin> in a <collision> (link 'tray') (did you mean "
       "'origin'?)"},
      {robot_with("<collision><surface/><geometry>" + box + "</geometry></collision>"),
       "bad.urdf:3:12: URDF has no <surface> in a <collision>"},
      {robot_with("<Collision><geometry>" + box + "</geometry></Collision>"),
       "bad.urdf:3:1: URDF has no <Collision> in a <link> (link 'tray') (did you mean "
       "'collision'?)"},
      {robot_with("<colision><geometry>" + box + "</geometry></colision>"),
       "bad.urdf:3:1: URDF has no <colision> in a <link>"},
      {robot_with("<visual><geometry>" + box + "</geometry>" + shape(box) + "</visual>"),
       "bad.urdf:3:49: a <collision> in a <visual> (link 'tray') is not read (put it into a "
       "<link>)"},
      {robot_with("<geometry>" + box + "</geometry>"),
       "bad.urdf:3:1: a <geometry> in a <link> (link 'tray') is not read (put it into a "
       "<collision>)"},
      {robot_with("<inertial><Geometry>" + box + "</Geometry></inertial>"),
       "bad.urdf:3:11: a <Geometry> in a <inertial> (link 'tray') is not read"},
      {robot_with("<collision_mesh><geometry>" + box + "</geometry></collision_mesh>"),
       "bad.urdf:3:1: URDF has no <collision_mesh> in a <link> (link 'tray'), so its <geometry> is "
       "not read (did you mean 'collision'?)"},
      {robot_with("<my:collision><geometry>" + box + "</geometry></my:collision>"),
       "bad.urdf:3:1: URDF has no <my:collision> in a <link> (link 'tray'), so its"},
      {robot_with("<shapes><more><bumper><geometry>" + box +
                  "</geometry></bumper></more></shapes>"),
       "bad.urdf:3:15: URDF has no <bumper> in a <more> (link 'tray'), so its"},
      {robot_with("<shapes>" + shape(box) + "</shapes>"),
       "bad.urdf:3:9: URDF has no <collision> in a <shapes> (link 'tray'), so its"},
      {robot_with("", "<bumper><geometry>" + box + "</geometry></bumper>"),
       "bad.urdf:6:74: URDF has no <bumper> in a <joint> (joint 'j'), so its"},
      {robot_with("</link><collison><geometry>" + box + "</geometry></collison><link name=\"x\">"),
       "bad.urdf:3:8: a <collison> in a <robot> is not read (put it into a <link>)"},
      {robot_with("</link><bumper><geometry>" + box + "</geometry></bumper><link name=\"x\">"),
       "bad.urdf:3:8: URDF has no <bumper> in a <robot>, so its"},
      {robot_with("</link><material name=\"m\"><collision/></material><link name=\"x\">"),
       "bad.urdf:3:27: a <collision> in a <material> is not read"},
      {robot_with("<Joint name=\"k\"/>"),
       "bad.urdf:3:1: a <Joint> in a <link> (link 'tray') is not read"},
      {robot_with("", "<lnk name=\"k\"/>"),
       "bad.urdf:6:74: a <lnk> in a <joint> (joint 'j') is not read (put it right into the"},
      {robot_with("", shape(box)),
       "bad.urdf:6:74: a <collision> in a <joint> (joint 'j') is not read"},
      {robot_with("</link>" + shape(box) + "<link name=\"x\">"),
       "bad.urdf:3:8: a <collision> in a <robot> is not read"},
      {robot_with("<link name=\"x\">" + shape(box) + "</link>"),
       "bad.urdf:3:1: a <link> in a <link> (link 'tray') is not read"},
      {robot_with(shape(box), "<limit velocity=\"1\"/>"), "a second <limit> in a <joint>"},
      {robot_with(shape(box), "<mimic multiplier=\"1\"/>"),
       "<mimic> of joint 'j' needs the attribute 'joint': a name"},
      {robot_with(shape(box), "<axis xzy=\"1 0 0\"/>"), "(did you mean 'xyz'?)"},
      {robot_with(shape(box), "<axis/>"), "<axis> of joint 'j' needs the attribute 'xyz'"},
      {robot_with("<xacro:box_inertia/>"), "bad.urdf:3:1: this is a xacro file"}};
  for (const Refusal& one : refusals) {
    const auto file = write_file(test_folder() / "bad.urdf", one.text);
    EXPECT_THAT(mistakes_in(file), HasSubstr(one.told)) << one.text;
    Loader loader;
    const auto robot = loader.load("{urdf: " + file + "}");
    ASSERT_FALSE(robot);
    EXPECT_EQ(robot.error().code, ErrorCode::kConfig);
  }
}

TEST(UrdfRules, LimitsAreWholeAndInOrder) {
  const auto with_limit = [](const std::string& type, const std::string& limit) {
    const std::string text =
        "<robot name=\"r\"><link name=\"a\">" + shape("<sphere radius=\"1\"/>") +
        "</link><link name=\"b\"/>\n<joint name=\"j\" type=\"" + type +
        "\"><parent link=\"a\"/><child link=\"b\"/>\n" + limit + "</joint></robot>";
    return mistakes_in(write_file(test_folder() / "r.urdf", text));
  };
  for (const char* type : {"revolute", "prismatic"}) {
    EXPECT_EQ(with_limit(type, ""), "");
    EXPECT_EQ(with_limit(type, "<limit lower=\"-1\" upper=\"1\" velocity=\"0\"/>"), "");
    EXPECT_THAT(with_limit(type, "<limit lower=\"-1\" velocity=\"1\"/>"),
                HasSubstr("r.urdf:3:1: <limit> of joint 'j' needs the attribute 'upper'"));
    EXPECT_THAT(with_limit(type, "<limit lower=\"-1\" upper=\"1\"/>"),
                HasSubstr("needs the attribute 'velocity'"));
    EXPECT_THAT(with_limit(type, "<limit lower=\"1\" upper=\"-1\" velocity=\"1\"/>"),
                HasSubstr("r.urdf:3:1: joint 'j' has its lower limit above its upper one"));
    EXPECT_THAT(with_limit(type, "<limit lower=\"1\" upper=\"2\" velocity=\"-1\"/>"),
                HasSubstr("r.urdf:3:28: <limit> of joint 'j' has velocity=\"-1\", expected a "
                          "number of at least 0"));
  }
  EXPECT_EQ(with_limit("continuous", "<limit velocity=\"1\"/>"), "");
  EXPECT_THAT(with_limit("continuous", "<limit effort=\"1\"/>"), HasSubstr("'velocity'"));
  EXPECT_EQ(with_limit("fixed", "<limit effort=\"0\"/>"), "");
}

TEST(UrdfRules, NumbersMayBeSignedSpacedAndOnSeveralLines) {
  const auto file = write_file(
      test_folder() / "r.urdf",
      robot_with("<collision><origin xyz=\" +1\t.5\n-2e-1 \"/><geometry><box size='1 2.  3'/>"
                 "</geometry></collision>"));
  std::vector<Error> errors;
  const auto model = urdf_robot::read_urdf(file, errors);
  ASSERT_TRUE(model) << errors.front().describe();
  const auto& shape = model->links[1].shapes.at(0);
  EXPECT_EQ(shape.T_link_shape.translation(), Eigen::Vector3d(1.0, 0.5, -0.2));
  EXPECT_EQ(std::get<Box>(shape.shape).size_m, Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(UrdfRules, PassOverWhatIsAnotherReaders) {
  const std::string other =
      "<visual name='>'><geometry><capsule/></geometry></visual><self_collision_checking/>"
      "<!-- <collision/> --><gazebo><collision/></gazebo><sensor><link/><joint/></sensor>"
      "<my:shell><geometry/></my:shell><my:collision filter='1'/><contacts><link/></contacts>"
      "<sensor><my:collision><geometry/></my:collision></sensor>"
      "<mujoco><body><geometry/></body></mujoco>" +
      shape("<box size=\"1 1 1\"/>") +
      "<collision><drake:proximity_properties/><verbose value=\"a > b\"/><geometry><box "
      "size=\"1 1 1\"/></geometry></collision>";
  EXPECT_EQ(mistakes_in(write_file(test_folder() / "r.urdf",
                                   robot_with(other, "<dynamics damping=\"x\"/>"))),
            "");
}

TEST(UrdfRules, CountShapesInTheTextOnceMore) {
  const std::string two = robot_with(shape("<box size=\"1 1 1\"/>"));
  EXPECT_EQ(urdf_robot::count_collisions(two), 2u);
  EXPECT_EQ(urdf_robot::count_collisions("<!-- " + two + " --><![CDATA[" + two + "]]><?p " + two),
            0u);
  for (const auto& file : shipped_urdfs()) {
    const std::string text = without_comments(read_text(file));
    const std::regex collision("<collision[\\s>]");
    EXPECT_EQ(urdf_robot::count_collisions(read_text(file)),
              static_cast<std::size_t>(
                  std::distance(std::sregex_iterator(text.begin(), text.end(), collision), {})));
  }
  // What a parser stops before is counted: a robot behind the robot, and behind a zero.
  for (const std::string& gap : {std::string(), std::string(1, '\0')}) {
    const auto file = write_file(test_folder() / "r.urdf", two + gap + two);
    EXPECT_THAT(
        mistakes_in(file),
        HasSubstr("r.urdf: the URDF has 4 <collision> elements, and 2 collision shapes were "
                  "read"));
    const auto bare = write_file(
        test_folder() / "r.urdf",
        two + gap + "<robot name='more'><link name='l'/><link name='m'/><joint name='j'/></robot>");
    EXPECT_THAT(mistakes_in(bare), AllOf(HasSubstr("r.urdf: the URDF has 4 <link> elements, and 2 "
                                                   "links were read"),
                                         HasSubstr("2 <joint> elements, and 1 joints were read")));
  }
}

}  // namespace
}  // namespace sidestep
