// What becomes of a prediction where its plugin is at fault.
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/predict.hpp>

#include "conformance/predictor_conformance.hpp"
#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using conformance::kTracked;
using conformance::track_at;
using testing::HasSubstr;
using testing_support::HostFixture;

constexpr double kHorizon_s = 4.0;

class PredictorFaults : public testing::Test {
 protected:
  Result<Prediction> predict_with(const std::string& fault) {
    auto predictor = fixture_.host.create<Predictor>(
        HostFixture::block("{plugin: faulty, fault: " + fault + "}"));
    if (!predictor) return error_of(predictor);
    return predict(**predictor, plugin_of(*predictor), {people_, kHorizon_s}, fixture_.log);
  }
  [[nodiscard]] int warnings() const { return fixture_.log.count(LogLevel::kWarning); }

  /// Of a point 12 m beside the first person.
  static double distance_m(const Prediction& prediction, double time_s) {
    const Eigen::Vector3d p_m(1.0, 14.0, 1.0);
    double distance = 0.0;
    prediction.query(time_s, {&p_m, 1}, {&distance, 1}, {});
    return distance;
  }

  HostFixture fixture_{{FAULTY_PLUGINS}};
  Tracks people_{{track_at(3, {1.0, 2.0}, {0.5, 0.0}), track_at(8, {-9.0, -9.0}, {0.0, 0.0})},
                 kTracked};
};

TEST_F(PredictorFaults, PassesOnWhatIsRight) {
  const auto prediction = predict_with("none");
  ASSERT_TRUE(prediction) << prediction.error().describe();
  EXPECT_NEAR(distance_m(*prediction, 2.0), 12.0 - 0.3 - 2.0 * 1.0, 1e-9);  // at its own 1 m/s
  EXPECT_EQ(warnings(), 0);
}

TEST_F(PredictorFaults, AssumesTheWorstAndNamesThePluginOnce) {
  const std::pair<const char*, const char*> faults[] = {
      {"throws", "threw: is on fire"},
      {"throws_a_number", "threw: something that is not a std::exception"},
      {"fails", "has no crystal ball"},
      {"nan", "track 8 has a number that is not finite"},
      {"late", "track 8 begins late, 0.1 s after the tracks"},
      {"ends_early", "track 8 ends after 2 s, before the horizon of 4 s"},
      {"old_stamp", "has the stamp 6.3"},
      {"leaves_one_out", "track 8 has no set"},
      {"invents_one", "track 9 is of none of the tracks"},
      {"too_likely", "likelihoods of track 8 sum to 2"}};
  int warned = 0;
  for (const auto& [fault, words] : faults) {
    SCOPED_TRACE(fault);
    const auto prediction = predict_with(fault);
    ASSERT_TRUE(prediction) << prediction.error().describe();
    EXPECT_EQ(prediction->stamp(), kTracked);
    EXPECT_EQ(prediction->sets().size(), 2u);
    // Two standard deviations of 0.1 m, at 1.6 m/s.
    for (const double time_s : {0.0, 1.0, kHorizon_s}) {
      EXPECT_NEAR(distance_m(*prediction, time_s), 12.0 - 0.3 - 0.2 - 1.6 * time_s, 1e-9);
    }
    ASSERT_EQ(warnings(), ++warned);
    const std::string message = fixture_.log.messages().back();
    EXPECT_THAT(message, HasSubstr("predictor faulty"));
    EXPECT_THAT(message, HasSubstr(words));
    EXPECT_THAT(message, HasSubstr("worst case"));
  }
}

TEST_F(PredictorFaults, FailsWhereTheTracksThemselvesAreWrong) {
  const Tracks sound = people_;
  const std::pair<std::function<void(Track&)>, const char*> mistakes[] = {
      {[](Track& track) { track.position_m.x() = std::nan(""); }, "not finite"},
      {[](Track& track) { track.velocity_mps.y() = INFINITY; }, "not finite"},
      {[](Track& track) { track.covariance(2, 3) = std::nan(""); }, "not finite"},
      {[](Track& track) { track.radius_m = -0.1; }, "negative radius"},
      {[](Track& track) { track.top_m = track.bottom_m - 0.1; }, "top below its bottom"}};
  for (const auto& [make, words] : mistakes) {
    people_ = sound;
    make(people_.tracks[0]);
    for (const char* fault : {"none", "throws"}) {
      const auto prediction = predict_with(fault);
      ASSERT_FALSE(prediction) << words;
      EXPECT_EQ(prediction.error().code, ErrorCode::kInvalidArgument);
      EXPECT_THAT(prediction.error().message, HasSubstr("track 3"));
      EXPECT_THAT(prediction.error().message, HasSubstr(words));
    }
  }
  EXPECT_EQ(warnings(), 0);  // no predictor is to blame
}

/// Says something of nothing that is tracked, for a while.
class Seer final : public Predictor {
 public:
  Result<Prediction> predict(const PredictionRequest& request) override {
    PredictedSet set;
    set.track = 77;
    set.top_m = 1.0;
    set.knots = {{1.0, {0.0, 0.0}, 0.5}};
    return Prediction::create({request.tracks.stamp.ns + offset_ns}, {set});
  }
  [[nodiscard]] PredictionSubject subject() const noexcept override { return its_subject; }
  std::int64_t offset_ns = 0;
  PredictionSubject its_subject = PredictionSubject::kThings;
};

TEST_F(PredictorFaults, LeavesTracksOutToOneThatIsNotOfThem) {
  Seer seer;
  const PredictionRequest request{people_, kHorizon_s};
  const auto prediction = predict(seer, "predictor seer", request, fixture_.log);
  ASSERT_TRUE(prediction) << prediction.error().describe();
  EXPECT_EQ(prediction->sets().at(0).track, 77);
  EXPECT_EQ(warnings(), 0);
  seer.its_subject = PredictionSubject::kTracks;
  const auto of_tracks = predict(seer, "predictor seer", request, fixture_.log);
  ASSERT_TRUE(of_tracks) << of_tracks.error().describe();
  EXPECT_EQ(of_tracks->sets().size(), 2u);
  EXPECT_EQ(warnings(), 1);
  seer.its_subject = PredictionSubject::kThings;
  seer.offset_ns = 1;  // its stamp is judged all the same
  const auto other = predict(seer, "predictor seer", request, fixture_.log);
  ASSERT_TRUE(other) << other.error().describe();
  EXPECT_EQ(other->sets().size(), 2u);
  EXPECT_EQ(warnings(), 2);
}

}  // namespace
}  // namespace sidestep
