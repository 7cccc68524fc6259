#include <array>
#include <cstdio>
#include <functional>

#include <gmock/gmock.h>

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
                       object("floor", HalfSpace{}, {0.0, 0.0, -0.3})});
    const auto found = certify(*robot_, scene,
                               straight({{0, -0.785, 0, -2.356, 0, 1.571, 0.785},
                                         {-1.0, -0.3, 0, -2.0, 0, 1.571, 0.785},
                                         {-1.2, 0.2, 0, -1.8, 0, 1.8, 0.785}},
                                        2.0),
                               {.margin_m = 0.005});
    if (!found) throw std::runtime_error(found.error().describe());
    if (found->outcome != Certification::Outcome::kProven) throw std::runtime_error("not proven");
    certificate_ = found->certificate;
  }

  /// What the program says.
  [[nodiscard]] std::string recheck(const Json& certificate) const {
    const std::string file = folder_.write("certificate.json", certificate.dump()).string();
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

TEST_F(Recheck, AcceptsWhatIsProven) { EXPECT_THAT(recheck(certificate_), HasSubstr("accepted")); }

/// Changes after which nobody has shown what is claimed, each drawn many times.
TEST_F(Recheck, RefusesWhatIsNotShown) {
  std::mt19937_64 random(9);
  const auto pick = [&](Json& list) -> Json& {
    return list[std::uniform_int_distribution<std::size_t>(0, list.size() - 1)(random)];
  };
  const auto draw = [&](double lower, double upper) {
    return std::uniform_real_distribution(lower, upper)(random);
  };
  const auto shape_of = [&](Json& body) -> Json& {
    for (const char* kind : {"box", "cylinder", "capsule", "sphere", "hull"}) {
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
      {"a part is gone",
       [&](Json& c) {
         Json& parts = pick(c["claims"])["parts"];
         parts.erase(std::uniform_int_distribution<std::size_t>(0, parts.size() - 1)(random));
       }},
      {"a claim is of other shapes",
       [&](Json& c) { pick(c["claims"])["shape"] = 1000 + static_cast<int>(draw(0, 1000)); }},
      {"a direction is turned round",
       [&](Json& c) {
         Json& claim = pick(c["claims"]);
         while (claim.value("object", -1) == 2) claim = c["claims"][0];  // a half-space has its own
         Json& part = pick(claim["parts"]);
         for (int k = 2; k < 5; ++k) part[k] = -part[k].get<int>();
       }},
      {"a part claims the time of two",
       [&](Json& c) {
         Json* part = nullptr;
         do {
           part = &pick(pick(c["claims"])["parts"]);
         } while ((*part)[0].get<int>() == 0);
         (*part)[0] = (*part)[0].get<int>() - 1;
         (*part)[1] = (*part)[1].get<int>() / 2;
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
      {"the format is another one", [&](Json& c) { c["format"] = "sidestep-certificate-2"; }},
      {"the robot has no pair", [&](Json& c) { c["robot"].erase("pairs"); }},
      {"time stands still", [&](Json& c) { c["motion"][0]["end_s"] = -draw(0.0, 1.0); }}};
  for (const auto& [what, make] : changes) {
    for (int k = 0; k < 50; ++k) {
      Json changed = certificate_;
      make(changed);
      ASSERT_THAT(recheck(changed), HasSubstr("refused")) << what << ", " << k;
    }
  }
}

}  // namespace
}  // namespace sidestep
