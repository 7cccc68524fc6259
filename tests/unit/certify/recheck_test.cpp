#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <sidestep/certificates/leave_certificate.hpp>

#include "certify_testing.hpp"
#include "robot_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using testing_certify::object;
using testing_certify::straight;

class Recheck : public ::testing::Test {
 protected:
  Recheck() {
    const Scene scene({object("table", Box{{1.0, 1.6, 0.05}}, {0.7, 0.0, 0.0}),
                       object("post", Cylinder{0.05, 0.8}, {0.5, 0.6, 0.4}),
                       object("floor", HalfSpace{}, {0.0, 0.0, -0.3}),
                       object("gate", gate(), {0.0, 0.0, 0.0})});
    const auto found = certify(*robot_, {scene, {ring()}},
                               straight({{0, -0.785, 0, -2.356, 0, 1.571, 0.785},
                                         {-1.0, -0.3, 0, -2.0, 0, 1.571, 0.785},
                                         {-1.2, 0.2, 0, -1.8, 0, 1.8, 0.785}},
                                        2.0),
                               {.margin_m = 0.005, .wants_certificate = true});
    if (!found) throw std::runtime_error(found.error().describe());
    if (found->outcome != Certification::Outcome::kProven) throw std::runtime_error("not proven");
    certificate_ = Json::parse(found->certificate);
  }

  /// Two triangles beside the arm, which is in their hull.
  static std::shared_ptr<const Mesh> gate() {
    Mesh mesh;
    mesh.vertices_m = {{-1, -1.2, 0}, {1, -1.2, 0}, {0, -1.2, 1},
                       {-1, 1.2, 0},  {1, 1.2, 0},  {0, 1.2, 1}};
    mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
    return std::make_shared<const Mesh>(std::move(mesh));
  }
  /// Cubes around the arm.
  static Swarm ring() {
    Swarm swarm{"ring", Swarm::Kind::kCubes, {}};
    for (int k = 0; k < 60; ++k) {
      const double bearing = 0.1 * k;
      swarm.members.push_back({{1.3 * std::cos(bearing), 1.3 * std::sin(bearing), 0.02 * k}, 0.05});
    }
    return swarm;
  }

  /// What the program says.
  [[nodiscard]] std::string recheck(const Json& certificate) const {
    return recheck(certificate.dump());
  }
  [[nodiscard]] std::string recheck(const std::string& text) const {
    const std::string file = folder_.write("certificate.json", text).string();
    std::string said;
    FILE* const pipe = popen((std::string(RECHECK) + " " + file + " 2>&1").c_str(), "r");
    std::array<char, 512> buffer{};
    while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) {
      said += buffer.data();
    }
    const bool is_accepted = pclose(pipe) == 0;
    EXPECT_EQ(is_accepted, said.find("accepted") != std::string::npos) << said;
    return said;
  }

  testing_support::TemporaryFolder folder_;
  testing_robot::Loader loader_;
  std::unique_ptr<KinematicTree> robot_ = loader_.load_or_fail("{profile: panda}");
  Json certificate_;
};

/// All nodes of a tree of parts, and of the trees in it, that are halved; else, that are not.
void collect(Json& tree, bool is_halved, std::vector<Json*>& found) {
  if (tree[0].is_string() == is_halved) found.push_back(&tree);
  if (!tree[0].is_string()) return;
  collect(tree[1], is_halved, found);
  collect(tree[2], is_halved, found);
}

TEST_F(Recheck, AcceptsWhatIsProven) {
  EXPECT_THAT(recheck(certificate_), HasSubstr("accepted"));
  const std::string text = certificate_.dump();
  for (const char* halved : {"\"time\"", "\"second\""}) EXPECT_THAT(text, HasSubstr(halved));
}

/// Of the objects of two lists, the last would be all.
TEST_F(Recheck, RefusesAKeyThatIsThereTwice) {
  std::string text = certificate_.dump();
  ASSERT_THAT(recheck(text), HasSubstr("accepted"));
  const std::size_t at = text.find("\"objects\":");
  ASSERT_NE(at, std::string::npos);
  text.insert(at, "\"objects\":" + certificate_["objects"].dump() + ",");
  EXPECT_THAT(recheck(text), HasSubstr("refused: an object has the key 'objects' twice"));
}

TEST_F(Recheck, RefusesWhatStartsInsideOfAClosedMesh) {
  Json changed = certificate_;
  const Mesh mesh = triangulate(Box{{6.0, 6.0, 6.0}});
  Json points = Json::array(), triangles = Json::array();
  for (const Eigen::Vector3d& p : mesh.vertices_m) points.push_back({p.x(), p.y(), p.z()});
  for (const Eigen::Vector3i& t : mesh.triangles) triangles.push_back({t[0], t[1], t[2]});
  changed["objects"][3]["mesh"] = {{"points", points}, {"triangles", triangles}};
  EXPECT_THAT(recheck(changed), HasSubstr(" is in object "));
}

/// A plan among what it is checked against: voxels, a floor that a link may stand on, a scene.
TEST_F(Recheck, AcceptsWhatAPlanLeaves) {
  const auto robot = testing_certify::crane(0.1);
  const Trajectory plan{2, {0.0, 2.0, 4.0}, {0.0, 0.6, 0.3, 0.6, 0.6, 0.6}, {0, 0, 0.2, 0, 0, 0}};
  ShapeObstacles obstacles;
  obstacles.resolution_m = 0.05;
  for (int k = 0; k < 50; ++k) {
    obstacles.occupied_centres_m.emplace_back(0.8 * std::cos(0.1 * k), 0.8 * std::sin(0.1 * k), 0);
  }
  obstacles.floor = Floor{.height_m = -0.05, .except_links = {"tip"}};
  obstacles.scene = std::make_shared<const Scene>(std::vector{
      object("rail", Sphere{0.1}, {0.6, 0.0, 0.1}), object("far", Sphere{0.1}, {0, -0.9, 0})});
  const auto file = folder_.path() / "certificates" / "plan.json";
  const auto left = [&](std::vector<AllowedContact> allowed) {
    const auto outcome = leave_certificate(*robot, obstacles, std::move(allowed), plan, file);
    return outcome ? std::string(name_of(*outcome)) : outcome.error().describe();
  };
  EXPECT_EQ(left({}), "refuted");
  EXPECT_EQ(left({{"tip", "far"}}), "refuted");
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_EQ(left({{"tip", "rail"}}), "proven");
  std::ifstream in(file);
  Json certificate = Json::parse(in);
  EXPECT_THAT(recheck(certificate), HasSubstr("accepted"));
  for (Json& one : certificate["objects"]) one.erase("may_touch");
  EXPECT_THAT(recheck(certificate), HasSubstr("nothing is claimed of shape "));
  obstacles.floor->except_links.clear();
  EXPECT_EQ(left({{"tip", "rail"}}), "refuted");
}

/// Changes after which nobody has shown what is claimed, each drawn many times.
TEST_F(Recheck, RefusesWhatIsNotShown) {
  std::mt19937_64 random(9);
  const auto pick = [&](Json& list) -> Json& {
    return list[std::uniform_int_distribution<std::size_t>(0, list.size() - 1)(random)];
  };
  const auto draw = [&](double lower, double upper) {
    return std::uniform_real_distribution(lower, upper)(random);
  };
  /// Of some claim.
  const auto node = [&](Json& c, bool is_halved) -> Json& {
    std::vector<Json*> found;
    while (found.empty()) collect(pick(c["claims"])["parts"], is_halved, found);
    return *found[std::uniform_int_distribution<std::size_t>(0, found.size() - 1)(random)];
  };
  const auto shape_of = [&](Json& body) -> Json& {
    for (const char* kind : {"box", "cylinder", "capsule", "sphere"}) {
      if (body.contains(kind)) return body[kind];
    }
    throw std::runtime_error("no shape");
  };
  struct Change {
    const char* what;
    std::function<void(Json&)> make;
  };
  const std::vector<Change> changes{
      {"a claim is gone",
       [&](Json& c) {
         Json& claims = c["claims"];
         claims.erase(std::uniform_int_distribution<std::size_t>(0, claims.size() - 1)(random));
       }},
      {"a half is gone",
       [&](Json& c) {
         Json& tree = node(c, true);
         tree.erase(draw(0, 1) < 0.5 ? 1 : 2);
       }},
      {"a claim is of other shapes",
       [&](Json& c) { pick(c["claims"])["shape"] = 1000 + static_cast<int>(draw(0, 1000)); }},
      {"a direction is turned round",
       [&](Json& c) {
         Json* claim = nullptr;
         do {
           claim = &pick(c["claims"]);
         } while (claim->value("object", -1) == 2);  // a half-space has its own
         std::vector<Json*> found;
         collect((*claim)["parts"], false, found);
         for (Json& k : *found[static_cast<std::size_t>(draw(0, 0.999) * found.size())]) {
           k = -k.get<int>();
         }
       }},
      {"cubes are halved more often than there are",
       [&](Json& c) {
         Json& tree = node(c, false);
         for (int k = 0; k < 7; ++k) tree = Json::array({"second", tree, tree});
       }},
      {"a triangle crosses the gate",
       [&](Json& c) {
         Json& triangles = c["objects"][3]["mesh"]["triangles"];
         triangles[static_cast<std::size_t>(draw(0, 1.999))] = {0, 4, draw(0, 1) < 0.5 ? 5 : 2};
       }},
      {"a cube stands in the arm",
       [&](Json& c) {
         pick(c["objects"][4]["cubes"]) = {0.0, 0.0, draw(0.2, 0.4), 0.05};
       }},
      {"the margin is greater", [&](Json& c) { c["margin_m"] = draw(0.5, 2.0); }},
      {"an object stands in the arm",
       [&](Json& c) {
         Json& one = c["objects"][static_cast<std::size_t>(draw(0.0, 1.999))];
         one["pose"][3] = 0.0;
         one["pose"][7] = 0.0;
         one["pose"][11] = draw(0.2, 0.4);
       }},
      {"the floor is higher", [&](Json& c) { c["objects"][2]["pose"][11] = draw(0.3, 1.0); }},
      {"an object has grown", [&](Json& c) { shape_of(c["objects"][1])[0] = draw(0.7, 2.0); }},
      {"a link has grown",
       [&](Json& c) {
         Json& shapes = c["robot"]["shapes"];
         Json& shape = shapes[shapes.size() - 1 - static_cast<std::size_t>(draw(0.0, 3.999))];
         const auto pose = shape["pose"];
         const int link = shape["link"].get<int>();
         shape = {{"link", link}, {"pose", pose}, {"sphere", draw(1.0, 3.0)}};
       }},
      {"an arm is longer",
       [&](Json& c) {
         Json& links = c["robot"]["links"];
         links[links.size() / 2]["pose"][3] = draw(3.0, 9.0);
         c["objects"][0] = {{"name", "everywhere"},
                            {"pose", c["objects"][0]["pose"]},
                            {"box", {6.0 + draw(0, 1), 30.0, 30.0}}};
       }},
      {"a joint turns at once",
       [&](Json& c) { pick(pick(c["motion"])["joints"])[0] = draw(-9.0, -5.0); }},
      {"the motion takes a moment",
       [&](Json& c) {
         c["motion"][1]["end_s"] = c["motion"][0]["end_s"].get<double>() + draw(1e-6, 1e-3);
       }},
      {"a limit is lower", [&](Json& c) { c["robot"]["joints"][0]["lower"] = draw(-0.9, -0.1); }},
      {"a joint is named that is none",
       [&](Json& c) { pick(c["robot"]["links"])["joint"] = 7 + static_cast<int>(draw(0, 9)); }},
      {"a number is text", [&](Json& c) { pick(pick(c["objects"])["pose"]) = "0"; }},
      {"an axis is longer",
       [&](Json& c) {
         pick(c["robot"]["links"])["axis"] = {1.0, draw(1, 2), 0};
       }},
      {"a joint is no whole number",
       [&](Json& c) { pick(c["robot"]["links"])["joint"] = draw(0.01, 5.99); }},
      {"something is claimed of what is not",
       [&](Json& c) {
         c["claims"].push_back(pick(c["claims"]));
         c["claims"].back()["shape"] = 1000;
       }},
      {"a pair stands twice",
       [&](Json& c) { c["robot"]["pairs"].push_back(pick(c["robot"]["pairs"])); }},
      {"a triangle has four corners",
       [&](Json& c) { pick(c["objects"][3]["mesh"]["triangles"]).push_back(0); }},
      {"the format is another one", [&](Json& c) { c["format"] = "sidestep-certificate-1"; }},
      {"the robot has no pair", [&](Json& c) { c["robot"].erase("pairs"); }},
      {"time stands still", [&](Json& c) { c["motion"][0]["end_s"] = -draw(0.0, 1.0); }}};
  for (const auto& [what, make] : changes) {
    for (int k = 0; k < 50; ++k) {
      Json changed = certificate_;
      make(changed);
      ASSERT_THAT(recheck(changed), HasSubstr("refused")) << what << ", " << k;
    }
  }
  Json nested;
  for (int k = 0; k < 300; ++k) nested = Json::array({std::move(nested)});
  Json changed = certificate_;
  changed["objects"][0]["may_touch"] = std::move(nested);
  EXPECT_THAT(recheck(changed), HasSubstr("refused: it is nested too deeply"));
}

}  // namespace
}  // namespace sidestep
