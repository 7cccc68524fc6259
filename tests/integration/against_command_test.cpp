#include <array>
#include <cmath>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;
using Json = nlohmann::json;

/// What the command says of its figures: a distance is too small by no more.
constexpr double kBound_m = 1e-3;
constexpr double kExact_m = 2e-6;

std::string collision(const std::string& geometry, const std::string& xyz = "0 0 0") {
  return "<collision><origin xyz=\"" + xyz + "\"/><geometry>" + geometry +
         "</geometry></collision>";
}
std::string box(const std::string& size) { return "<box size=\"" + size + "\"/>"; }
std::string mesh(const std::string& uri) { return "<mesh filename=\"" + uri + "\"/>"; }
std::string link(const std::string& name, const std::string& content = {}) {
  return "<link name=\"" + name + "\">" + content + "</link>\n";
}
std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& rest = {}) {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/>" + rest + "</joint>\n";
}
constexpr const char* kShoulder =
    R"(<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="1" effort="1"/>)";
constexpr const char* kElbow =
    R"(<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/>)";

/// An arm of three links; what is not said otherwise is the same in the profile and in the URDF
/// that it is held against.
struct Arm {
  std::string base = collision(box("0.4 0.4 0.2"));
  std::string upper = collision(R"(<cylinder radius="0.05" length="0.3"/>)", "0 0 0.2");
  std::string fore = collision(box("0.1 0.1 0.2"), "0 0 0.1");
  std::string shoulder = kShoulder;
  std::string elbow = kElbow;
  std::string more = {};  ///< Links and joints.

  [[nodiscard]] std::string text() const {
    return "<robot name=\"arm\">\n" + link("base", base) + link("upper", upper) +
           link("fore", fore) + joint("shoulder", "revolute", "base", "upper", shoulder) +
           joint("elbow", "revolute", "upper", "fore", elbow) + more + "</robot>\n";
  }
};

class AgainstCommandTest : public ::testing::Test {
 protected:
  void write_profile(const Arm& arm, const std::string& more = {}) const {
    folder_.write("arm/arm.urdf", arm.text());
    folder_.write("arm/profile.yaml", "name: arm\nurdf: arm.urdf\njoints: [shoulder, elbow]\n" +
                                          (more.empty() ? kWideSpheres : more));
  }
  [[nodiscard]] Finished against(const std::string& urdf,
                                 const std::vector<std::string>& more = {"--json"}) const {
    const auto file = folder_.write("mine.urdf", urdf);
    std::vector<std::string> arguments{"robot", (folder_.path() / "arm").string(), "--against",
                                       file.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  [[nodiscard]] Json figures(const std::string& urdf, int exit_code) const {
    const Finished finished = against(urdf);
    EXPECT_EQ(finished.exit_code, exit_code) << finished.out << finished.error;
    Json json = Json::parse(finished.out, nullptr, false);
    EXPECT_EQ(json.at("checked"), exit_code == 0);
    EXPECT_EQ(json.at("findings").empty(), exit_code == 0);
    return json;
  }
  /// `findings` or `notes`.
  [[nodiscard]] static std::vector<std::string> said(const Json& json, const char* key) {
    return json.at(key).get<std::vector<std::string>>();
  }
  [[nodiscard]] static Json row(const Json& json, const std::string& link) {
    for (const Json& one : json.at("links")) {
      if (one.at("link") == link) return one;
    }
    ADD_FAILURE() << "no link " << link;
    return {};
  }
  static void expect_point(const Json& point, double x, double y, double z, double bound_m) {
    EXPECT_NEAR(point.at(0).get<double>(), x, bound_m);
    EXPECT_NEAR(point.at(1).get<double>(), y, bound_m);
    EXPECT_NEAR(point.at(2).get<double>(), z, bound_m);
  }

  inline static const std::string kWideSpheres = R"(spheres:
  - {link: base, centre_m: [0, 0, 0], radius_m: 0.4}
  - {link: upper, centre_m: [0, 0, 0.2], radius_m: 0.3}
  - {link: fore, centre_m: [0, 0, 0.1], radius_m: 0.2}
)";
  testing_support::TemporaryFolder folder_;
};

TEST_F(AgainstCommandTest, ChecksWhatStandsOutByNoMoreThanFiveMillimetres) {
  for (const double missing_m : {0.0, 0.004, 0.006}) {
    SCOPED_TRACE(missing_m);
    // The profile's box ends before the robot's, ahead of it.
    Arm own;
    own.base = collision(box(std::to_string(0.4 - missing_m) + " 0.4 0.2"),
                         std::to_string(-0.5 * missing_m) + " 0 0");
    write_profile(own);
    const Json json = figures(Arm().text(), missing_m > 0.005 ? 1 : 0);
    const Json base = row(json, "base");
    EXPECT_NEAR(base.at("surface_m2").get<double>(), 0.64, 1e-9);
    const Json& shapes = base.at("shapes");
    EXPECT_NEAR(shapes.at("farthest_m").get<double>(), missing_m, kExact_m);
    // The face, and the rim around it.
    const double outside_m2 = missing_m > 0.0 ? 0.4 * 0.2 + 2.0 * (0.4 + 0.2) * missing_m : 0.0;
    EXPECT_NEAR(shapes.at("outside_m2").get<double>(), outside_m2, 1.2 * kBound_m);
    EXPECT_EQ(base.at("spheres").at("farthest_m"), 0.0);
    if (missing_m > 0.0) {
      EXPECT_NEAR(shapes.at("p_link_m").at(0).get<double>(), 0.2, kExact_m);
    } else {
      EXPECT_TRUE(shapes.at("p_link_m").is_null());
    }
  }
  const Finished table = against(Arm().text(), {});
  EXPECT_EQ(table.exit_code, 1);
  EXPECT_THAT(table.out,
              HasSubstr("link 'base' stands out of the profile's shapes by 6.0 mm at (0.200, "));
  EXPECT_THAT(table.out, HasSubstr("not checked: 1 finding"));
}

TEST_F(AgainstCommandTest, FindsTheFarthestPointOfAMeshAndOfACylinder) {
  Arm own;
  own.upper = collision(R"(<cylinder radius="0.044" length="0.3"/>)", "0 0 0.2");
  write_profile(own);
  // A pyramid on its side, whose tip is 30 mm ahead of the profile's box.
  const std::vector<std::string> corners{"-0.1 -0.1 -0.1", "-0.1 0.1 -0.1", "-0.1 0 0.09",
                                         "0.23 0.01 0.02"};
  std::string stl = "solid tip\n";
  for (const auto& [a, b, c] : {std::array{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const int corner : {a, b, c})
      stl += "vertex " + corners[static_cast<std::size_t>(corner)] + "\n";
    stl += "endloop\nendfacet\n";
  }
  folder_.write("meshes/mine_meshes/tip.stl", stl + "endsolid tip\n");
  Arm robot;
  robot.base = collision(mesh("package://mine_meshes/tip.stl"));
  const Finished finished =
      against(robot.text(), {"--json", "--package-path", (folder_.path() / "meshes").string()});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  const Json json = Json::parse(finished.out);
  const Json base = row(json, "base").at("shapes");
  EXPECT_NEAR(base.at("farthest_m").get<double>(), 0.03, kExact_m);
  expect_point(base.at("p_link_m"), 0.23, 0.01, 0.02, kExact_m);
  const Json upper = row(json, "upper").at("shapes");
  EXPECT_NEAR(upper.at("farthest_m").get<double>(), 0.006, 1e-4);
  const Json& p = upper.at("p_link_m");
  EXPECT_NEAR(std::hypot(p.at(0).get<double>(), p.at(1).get<double>()), 0.05, 1e-4);
}

TEST_F(AgainstCommandTest, FindsWhatSpheresMissThoughShapesHaveIt) {
  // A cube's corners are sqrt(3) * 0.1 m from its middle; two balls leave out the edges between
  // them, far from every corner.
  Arm arm;
  arm.base = collision(box("0.2 0.2 0.2"));
  arm.fore = collision(box("0.2 0.1 0.1"));
  write_profile(arm, R"(spheres:
  - {link: base, centre_m: [0, 0, 0], radius_m: 0.165205}
  - {link: upper, centre_m: [0, 0, 0.2], radius_m: 0.3}
  - {link: fore, centre_m: [-0.1, 0, 0], radius_m: 0.11}
  - {link: fore, centre_m: [0.1, 0, 0], radius_m: 0.11}
)");
  const Json json = figures(arm.text(), 1);
  for (const char* link : {"base", "upper", "fore"}) {
    EXPECT_EQ(row(json, link).at("shapes").at("farthest_m"), 0.0);
  }
  const Json base = row(json, "base").at("spheres");
  EXPECT_NEAR(base.at("farthest_m").get<double>(), 0.1 * std::sqrt(3.0) - 0.165205, kExact_m);
  for (const Json& value : base.at("p_link_m"))
    EXPECT_NEAR(std::abs(value.get<double>()), 0.1, kExact_m);
  const Json fore = row(json, "fore").at("spheres");
  const double truth_m = std::sqrt(0.1 * 0.1 + 2.0 * 0.05 * 0.05) - 0.11;
  EXPECT_LE(fore.at("farthest_m").get<double>(), truth_m + kExact_m);
  EXPECT_GE(fore.at("farthest_m").get<double>(), truth_m - kBound_m);
  const Json& p = fore.at("p_link_m");
  EXPECT_NEAR(p.at(0).get<double>(), 0.0, 2.0 * kBound_m);
  EXPECT_NEAR(std::abs(p.at(1).get<double>()), 0.05, 2.0 * kBound_m);
  EXPECT_NEAR(std::abs(p.at(2).get<double>()), 0.05, 2.0 * kBound_m);
}

TEST_F(AgainstCommandTest, ChecksOnlyWhatIsProvenBetweenThePointsThatAreLookedAt) {
  // Two balls leave out the edges of a bar between them; the farthest point is no vertex, and the
  // shift takes it off the middles, too.
  Arm arm;
  arm.fore = collision(box("0.2 0.1 0.1"));
  for (const auto& [out_m, exit_code] : {std::pair{0.0040, 0}, {0.0046, 0}, {0.0053, 1}}) {
    for (const double shift_m : {0.0, 0.00041, 0.00328}) {
      SCOPED_TRACE(std::to_string(out_m) + " shifted by " + std::to_string(shift_m));
      const std::string radius = std::to_string(std::sqrt(0.1 * 0.1 + 2.0 * 0.05 * 0.05) - out_m);
      const auto ball = [&](double x_m) {
        return "  - {link: fore, centre_m: [" + std::to_string(x_m) +
               ", 0, 0], radius_m: " + radius + "}\n";
      };
      write_profile(arm,
                    "spheres:\n  - {link: base, centre_m: [0, 0, 0], radius_m: 0.4}\n"
                    "  - {link: upper, centre_m: [0, 0, 0.2], radius_m: 0.3}\n" +
                        ball(shift_m - 0.1) + ball(shift_m + 0.1));
      const Json fore = row(figures(arm.text(), exit_code), "fore").at("spheres");
      const double found_m = fore.at("farthest_m").get<double>();
      EXPECT_LE(found_m, out_m + kExact_m);
      EXPECT_GE(found_m, out_m - kBound_m);
      EXPECT_GE(fore.at("at_most_m").get<double>(), out_m - kExact_m);
      EXPECT_LE(fore.at("at_most_m").get<double>(), found_m + kBound_m);
    }
  }
}

TEST_F(AgainstCommandTest, FindsWhatCannotBeProven) {
  Arm own;
  own.base = collision(box("0.39505 0.4 0.2"), "-0.002475 0 0");  // 4.95 mm less
  write_profile(own);
  EXPECT_THAT(said(figures(Arm().text(), 1), "findings"),
              ElementsAre(::testing::MatchesRegex(
                  "link 'base' stands out of the profile's shapes by (4.9|5.0) mm at .*, and by no "
                  "more than 5.. mm elsewhere")));
}

TEST_F(AgainstCommandTest, AttributesLinksThatTheProfileLacks) {
  write_profile(Arm());
  Arm robot;
  robot.more =
      // On top of the upper arm, turned so that its x is the arm's z: 20 mm higher than the
      // cylinder.
      link("plate") + link("tray", collision(box("0.02 0.04 0.04"), "0.01 0 0")) +
      joint("plate_joint", "fixed", "upper", "plate", R"(<origin xyz="0 0 0.3"/>)") +
      joint("tray_joint", "fixed", "plate", "tray",
            R"(<origin xyz="0 0 0.05" rpy="0 -1.5707963267949 0"/>)") +
      // Within the base.
      link("wheel", collision(R"(<cylinder radius="0.04" length="0.02"/>)")) +
      joint("wheel_joint", "continuous", "base", "wheel", R"(<axis xyz="0 0 1"/>)");
  const Json json = figures(robot.text(), 1);
  EXPECT_THAT(said(json, "findings"), ElementsAre(HasSubstr("link 'tray' stands out")));
  const Json tray = row(json, "tray");
  EXPECT_EQ(tray.at("with"), "upper");
  EXPECT_NEAR(tray.at("shapes").at("farthest_m").get<double>(), 0.02, kExact_m);
  EXPECT_NEAR(tray.at("shapes").at("p_link_m").at(0).get<double>(), 0.02, kExact_m);
  EXPECT_EQ(row(json, "wheel").at("with"), "base");
  EXPECT_THAT(said(json, "notes"),
              Contains(HasSubstr("unknown to the profile and taken at rest: wheel_joint at 0")));
}

TEST_F(AgainstCommandTest, DoesNotCarryLinksAcrossPlannedJoints) {
  write_profile(Arm());
  // The forearm of the robot hangs on a mount that the profile does not have.
  Arm mounted;
  std::string text = mounted.text();
  const std::string child = "<child link=\"fore\"/>";
  text.replace(text.find(child), child.size(), "<child link=\"mount\"/>");
  const std::string more = link("mount", collision(box("0.05 0.05 0.05"), "0 0 0.1")) +
                           joint("mount_joint", "fixed", "mount", "fore") + "</robot>";
  text.replace(text.find("</robot>"), 8, more);
  EXPECT_EQ(row(figures(text, 0), "mount").at("with"), "fore");
  // Without the forearm, the planned elbow is between the mount and all that the profile has.
  const std::size_t fore = text.find("<link name=\"fore\"");
  text.erase(fore, text.find('\n', fore) - fore);
  const std::size_t last = text.find("<joint name=\"mount_joint\"");
  text.erase(last, text.find('\n', last) - last);
  const Json json = figures(text, 1);
  EXPECT_THAT(
      said(json, "findings"),
      ElementsAre("link 'mount' has collision shapes, and the profile has no link that moves "
                  "with it"));
}

TEST_F(AgainstCommandTest, RefusesOtherKinematics) {
  Arm own;
  own.more = link("lid") + joint("lid_joint", "revolute", "base", "lid",
                                 R"(<axis xyz="0 0 1"/><mimic joint="shoulder" multiplier="0.5"/>
                                    <limit lower="-1" upper="1" velocity="1" effort="1"/>)");
  write_profile(own);
  EXPECT_EQ(figures(own.text(), 0).at("poses").size(), 4U);

  Arm shifted = own;
  shifted.shoulder.replace(shifted.shoulder.find("0 0 0.3"), 7, "0 0.002 0.3");
  const Json json = figures(shifted.text(), 1);
  EXPECT_TRUE(json.at("links").empty());
  EXPECT_THAT(said(json, "findings"),
              ElementsAre(HasSubstr("link 'upper' is 2.00 mm and 0.00 mrad"),
                          HasSubstr("link 'fore' is 2.00 mm")));
  EXPECT_NEAR(json.at("poses").at(1).at("offset_m").get<double>(), 0.002, 1e-9);

  Arm nearly = own;
  nearly.shoulder.replace(nearly.shoulder.find("0 0 0.3"), 7, "0 0.0009 0.3");
  EXPECT_EQ(figures(nearly.text(), 0).at("links").size(), 3U);

  // At the default configuration these are the same.
  Arm turned = own;
  turned.elbow.replace(turned.elbow.find("0 1 0"), 5, "0 -1 0");
  EXPECT_THAT(said(figures(turned.text(), 1), "findings"),
              ElementsAre(HasSubstr("link 'fore' is 0.00 mm")));
  Arm mimicking = own;
  mimicking.more.replace(mimicking.more.find("0.5"), 3, "0.6");
  // As the shoulder goes to 2 rad.
  EXPECT_THAT(said(figures(mimicking.text(), 1), "findings"),
              ElementsAre("link 'lid' is 0.00 mm and 200.00 mrad from where the profile has it"));
}

TEST_F(AgainstCommandTest, HoldsJointsWhereTheProfileHoldsThem) {
  const std::string limits = R"(<limit lower="-1" upper="1" velocity="1" effort="1"/>)";
  Arm arm;
  arm.more = link("motor_link") + joint("motor", "revolute", "fore", "motor_link", limits) +
             link("finger", collision(box("0.02 0.02 0.1"), "0 0 0.05")) +
             joint("finger_joint", "revolute", "fore", "finger",
                   limits + R"(<origin xyz="0 0 0.2"/><mimic joint="motor" multiplier="-1"/>)");
  write_profile(arm, kWideSpheres +
                         "  - {link: finger, centre_m: [0, 0, 0.05], radius_m: 0.1}\n"
                         "fixed_joints: {motor: 0.3}\n");
  EXPECT_THAT(said(figures(arm.text(), 0), "notes"),
              ElementsAre("held still, as the profile says: motor at 0.3"));
}

TEST_F(AgainstCommandTest, ReportsJointsAndLimitsThatTheRobotDoesNotHave) {
  write_profile(
      Arm(), kWideSpheres + "joint_limits: {shoulder: {lower: -1.5}, elbow: {max_velocity: 3}}\n");
  Arm robot;
  EXPECT_THAT(said(figures(robot.text(), 1), "findings"),
              UnorderedElementsAre(
                  "the profile plans joint 'shoulder' from -1.5 to 2 rad; the URDF allows -1 to 2",
                  "the profile plans joint 'elbow' at up to 3 rad/s; the URDF allows 1"));
  std::string renamed = robot.text();
  renamed.replace(renamed.find("name=\"elbow\""), 12, "name=\"elbow_joint\"");
  EXPECT_THAT(said(figures(renamed, 1), "findings"),
              Contains(HasSubstr("the profile plans joint 'elbow', which the URDF lacks")));
}

TEST_F(AgainstCommandTest, DoesNotPassOverWhatItCannotRead) {
  write_profile(Arm());
  Arm robot;
  robot.base = collision(mesh("package://mine_meshes/base.stl"));
  const Finished missing = against(robot.text());
  EXPECT_EQ(missing.exit_code, 2) << missing.out;
  EXPECT_THAT(missing.out, IsEmpty());
  for (const char* word : {"link 'base'", "package://mine_meshes/base.stl", "--package-path"}) {
    EXPECT_THAT(missing.error, HasSubstr(word));
  }
  folder_.write("mine_meshes/base.ply", "ply");
  robot.base = collision(mesh("package://mine_meshes/base.ply"));
  const Finished unknown = against(robot.text());
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.error,
              HasSubstr("base.ply: link 'base': meshes are read from .stl, .obj and .dae"));
  EXPECT_THAT(unknown.error, HasSubstr("assimp export"));
  EXPECT_EQ(against("<robot name=\"arm\">\n<link/>\n</robot>").exit_code, 2);
  EXPECT_EQ(run({"robot", (folder_.path() / "arm").string(), "--against", "none.urdf"}).exit_code,
            2);
  EXPECT_EQ(run({"robot", "hsr", "--package-path", "x"}).exit_code, 2) << "without --against";
  EXPECT_EQ(against(robot.text(), {"--fit"}).exit_code, 2);
}

TEST_F(AgainstCommandTest, FindsNothingToCheckAFinding) {
  write_profile(Arm());
  Arm bare;
  bare.base = "<visual><geometry>" + box("0.4 0.4 0.2") + "</geometry></visual>";
  const Json one = figures(bare.text(), 0);
  EXPECT_THAT(said(one, "notes"), Contains(HasSubstr("which alone count: base")));
  EXPECT_THAT(one.at("verdict").get<std::string>(),
              EndsWith(" by more than 5 mm; 1 link without collision shapes was not"));
  bare.upper = bare.base;
  EXPECT_THAT(figures(bare.text(), 0).at("verdict").get<std::string>(),
              EndsWith("; 2 links without collision shapes were not"));
  EXPECT_THAT(figures(Arm().text(), 0).at("verdict").get<std::string>(),
              EndsWith(" by more than 5 mm"));
  bare.upper = bare.fore = "";
  EXPECT_THAT(said(figures(bare.text(), 1), "findings"),
              ElementsAre("the URDF has no collision shapes"));
  const std::string other = "<robot name=\"other\">" + link("foot", collision(box("1 1 1")));
  EXPECT_THAT(said(figures(other + "</robot>", 1), "findings"),
              Contains("the profile and the URDF have no link in common"));
}

/// The public description of the HSR, without its meshes.
std::string hsr_urdf(const Json& facts) {
  const auto triple = [](const Json& values) {
    std::string text;
    for (const Json& value : values) text += value.dump() + " ";
    return text;
  };
  const auto origin = [&](const Json& of) {
    return "<origin xyz=\"" + triple(of.at("origin_xyz")) + "\" rpy=\"" +
           triple(of.at("origin_rpy")) + "\"/>";
  };
  std::set<std::string> links;
  std::string text = "<robot name=\"hsrb\">\n";
  for (const char* list : {"chain_joints", "other_joints"}) {
    for (const Json& one : facts.at(list)) {
      links.insert({one.at("parent"), one.at("child")});
      std::string rest = origin(one);
      if (one.contains("axis")) rest += "<axis xyz=\"" + triple(one.at("axis")) + "\"/>";
      for (const char* part : {"limit", "mimic"}) {
        if (!one.contains(part)) continue;
        rest += std::string("<") + part;
        for (const auto& [key, value] : one.at(part).items()) {
          rest += " " + key + "=\"" +
                  (value.is_string() ? value.get<std::string>() : value.dump()) + "\"";
        }
        rest += "/>";
      }
      text += joint(one.at("name"), one.at("type"), one.at("parent"), one.at("child"), rest);
    }
  }
  for (const std::string& name : links) {
    std::string shapes;
    for (const Json& one : facts.at("collision_geometry_refs").value(name, Json::array())) {
      const std::string kind = one.at("geometry");
      if (kind == "mesh") continue;
      shapes += "<collision>" + origin(one) + "<geometry><" + kind;
      for (const char* key : {"radius", "length", "size"}) {
        if (one.contains(key))
          shapes += std::string(" ") + key + "=\"" + one.at(key).get<std::string>() + "\"";
      }
      shapes += "/></geometry></collision>";
    }
    text += link(name, shapes);
  }
  return text + "</robot>\n";
}

TEST_F(AgainstCommandTest, HoldsTheHsrAgainstItsPublicDescription) {
  std::ifstream file(SIDESTEP_SHARED_FACTS "/hsr.json");
  if (!file) GTEST_SKIP() << "no " SIDESTEP_SHARED_FACTS;
  const auto urdf = folder_.write("hsr.urdf", hsr_urdf(Json::parse(file).at("hsrb_description")));
  const Finished finished = run({"robot", "hsr", "--against", urdf.string(), "--json"});
  const Json json = Json::parse(finished.out, nullptr, false);
  ASSERT_TRUE(json.is_object()) << finished.error;
  EXPECT_GT(json.at("poses").size(), 25U);
  for (const Json& pose : json.at("poses")) {
    EXPECT_LT(pose.at("offset_m").get<double>(), 1e-6) << pose;
    EXPECT_LT(pose.at("turn_rad").get<double>(), 1e-6) << pose;
  }
  std::set<std::string> links;
  for (const Json& one : json.at("links")) {
    const std::string name = one.at("link");
    links.insert(name);
    EXPECT_TRUE(one.at("with") == name || one.at("with") == "base_link") << name;
  }
  EXPECT_THAT(links, ElementsAre("base_l_drive_wheel_link", "base_l_passive_wheel_z_link",
                                 "base_r_drive_wheel_link", "base_r_passive_wheel_z_link",
                                 "wrist_flex_link"));
  EXPECT_EQ(row(json, "wrist_flex_link").at("shapes").at("farthest_m"), 0.0);
  EXPECT_EQ(json.at("findings"), Json::array());
  EXPECT_EQ(finished.exit_code, 0) << finished.out;
}

}  // namespace
}  // namespace sidestep::testing
