#include "sphere_desk.hpp"

#include "profile_fixture.hpp"
#include "unit/viewer/decoded_message.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::json;
using testing_support::DecodedMessage;
using testing_support::ProfileFixture;

class SphereDeskTest : public ProfileFixture {
 protected:
  void SetUp() override {
    ProfileFixture::SetUp();
    auto opened = open();
    ASSERT_TRUE(opened) << opened.error().describe();
    profile_ = std::make_unique<SphereProfile>(std::move(*opened));
    desk_ = std::make_unique<SphereDesk>(*profile_);
  }
  [[nodiscard]] std::optional<Json> ask(const std::string& request) {
    const auto message = desk_->answer(request, {});
    if (!message) return std::nullopt;
    return DecodedMessage(*message->bytes).header;
  }
  [[nodiscard]] Json ask(Json request) { return ask(request.dump()).value_or(Json()); }

  static inline const Json kSpheres = {{{"link", 0}, {"centre_m", {0, 0, 0}}, {"radius_m", 0.18}},
                                       {{"link", 1}, {"centre_m", {0, 0, 0}}, {"radius_m", 0.21}}};

  std::unique_ptr<SphereProfile> profile_;
  std::unique_ptr<SphereDesk> desk_;
};

TEST_F(SphereDeskTest, TellsRobotPosesAndCoverFirst) {
  const auto greeting = desk_->greeting();
  ASSERT_EQ(greeting.size(), 3U);
  const DecodedMessage world(*greeting[0].bytes), state(*greeting[1].bytes);
  const DecodedMessage profile(*greeting[2].bytes);
  EXPECT_EQ(world.kind(), "world");
  EXPECT_EQ(world.header.at("spheres").size(), 2U);
  EXPECT_EQ(world.header.at("shapes").size(), 2U);
  EXPECT_EQ(state.kind(), "state");
  EXPECT_EQ(state.header.at("q"), Json({0.5}));
  EXPECT_EQ(profile.kind(), "profile");
  EXPECT_EQ(profile.header.at("revision"), profile_->revision());
  EXPECT_EQ(profile.header.at("cover").at("links").size(), 2U);
  // The corners of a box of 0.2 m are nearer than 0.2 m.
  EXPECT_EQ(profile.header.at("cover").at("links").at(0).at("surface_share"), 1.0);
}

TEST_F(SphereDeskTest, MeasuresWhatItIsSent) {
  const Json reply = ask(Json{{"request", 7}, {"spheres", kSpheres}});
  EXPECT_EQ(reply.at("kind"), "reply");
  EXPECT_EQ(reply.at("request"), 7);
  EXPECT_EQ(reply.at("cover").at("whole").at("spheres"), 2);
  EXPECT_EQ(reply.at("cover").at("whole").at("gap_m"), 0.0);
}

TEST_F(SphereDeskTest, FitsAllOrOneLink) {
  const Json all =
      ask(Json{{"request", 1}, {"fit", {{"protrusion_m", 0.05}}}, {"spheres", kSpheres}});
  EXPECT_GT(all.at("spheres").size(), 2U);
  EXPECT_LE(all.at("cover").at("whole").at("protrusion_m"), 0.05);
  EXPECT_EQ(all.at("cover").at("whole").at("gap_m"), 0.0);
  const Json one =
      ask(Json{{"request", 2}, {"fit", {{"count", 3}, {"link", 1}}}, {"spheres", kSpheres}});
  EXPECT_EQ(one.at("spheres").at(0), kSpheres[0]);
  EXPECT_LE(one.at("spheres").size(), 4U);
}

TEST_F(SphereDeskTest, SavesWhatBelongsToTheRevision) {
  const std::string before = profile_->revision();
  const Json saved = ask(Json{{"request", 3}, {"save", before}, {"spheres", kSpheres}});
  EXPECT_EQ(saved.at("saved"), profile_->revision());
  EXPECT_NE(text().find("radius_m: 0.21}"), std::string::npos);
  const std::string now = text();
  // Another page, which has seen what was there before.
  const Json late = ask(Json{{"request", 4}, {"save", before}, {"spheres", Json::array()}});
  EXPECT_TRUE(late.contains("refused"));
  const Json none =
      ask(Json{{"request", 5}, {"save", profile_->revision()}, {"spheres", Json::array()}});
  EXPECT_TRUE(none.contains("refused"));
  EXPECT_EQ(text(), now);
}

TEST_F(SphereDeskTest, UnderstandsNothingElse) {
  const auto with = [](const char* key, const Json& value) {
    Json json = {{"request", 1}, {"spheres", kSpheres}};
    json[key] = value;
    return json.dump();
  };
  const auto with_sphere = [&](const char* key, const Json& value) {
    Json sphere = kSpheres[0];
    sphere[key] = value;
    return with("spheres", Json::array({sphere}));
  };
  for (const std::string& request : {std::string(),
                                     std::string("{"),
                                     std::string("[]"),
                                     std::string("{\"slice\":null}"),
                                     std::string("{\"request\":1}"),
                                     with("request", -1),
                                     with("request", 0.5),
                                     with("request", "1"),
                                     with("file", "/etc/passwd"),
                                     with("save", 5),
                                     with("fit", 3),
                                     with("fit", Json::object()),
                                     with("fit", {{"protrusion_m", 0.0}}),
                                     with("fit", {{"protrusion_m", 0.1}, {"count", 3}}),
                                     with("fit", {{"count", 0}}),
                                     with("fit", {{"count", 100000}}),
                                     with("fit", {{"count", 2}, {"link", 2}}),
                                     with("fit", {{"count", 2}, {"file", "x"}}),
                                     with("spheres", 5),
                                     with("spheres", Json(std::vector<Json>(1001, kSpheres[0]))),
                                     with_sphere("link", 2),
                                     with_sphere("link", -1),
                                     with_sphere("radius_m", 0.0),
                                     with_sphere("radius_m", "1"),
                                     with_sphere("radius_m", 1e300),
                                     with_sphere("centre_m", {0, 0}),
                                     with_sphere("centre_m", {0, 0, nullptr}),
                                     with_sphere("colour", 1)}) {
    EXPECT_FALSE(ask(request)) << request.substr(0, 120);
  }
  EXPECT_FALSE(ask(std::string(100'000, '[')));
  EXPECT_EQ(text(), kProfile);
}

}  // namespace
}  // namespace sidestep
