#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/prediction.hpp>

#include "analytic_models.hpp"

/// What every Predictor must hold. In a test of your own:
///
///     INSTANTIATE_TEST_SUITE_P(mine, PredictorConformance,
///                              testing::Values(PredictorCase{"mine", [] { return make_mine();
///                              }}));
namespace sidestep::conformance {

struct PredictorCase {
  std::string name;
  std::function<std::shared_ptr<Predictor>()> make;

  friend std::ostream& operator<<(std::ostream& out, const PredictorCase& c) {
    return out << c.name;
  }
};

constexpr Stamp kTracked{7'300'000'000};

[[nodiscard]] inline Track track_at(std::int64_t id, const Eigen::Vector2d& position_m,
                                    const Eigen::Vector2d& velocity_mps) {
  Track track;
  track.id = id;
  track.position_m = position_m;
  track.velocity_mps = velocity_mps;
  track.covariance = Eigen::Vector4d(0.01, 0.01, 0.04, 0.04).asDiagonal();
  track.radius_m = 0.3;
  track.top_m = 1.8;
  track.last_seen = kTracked;
  return track;
}

/// People who walk about at up to 2 m/s, as a tracker that is not sure of them sees them.
[[nodiscard]] inline Tracks walking_people(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-5.0, 5.0), speed(-1.4, 1.4), spread(-0.3, 0.3);
  Tracks people{{}, kTracked};
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d at_m(place(random), place(random));
    Track track = track_at(3 * i + 1, at_m, {speed(random), speed(random)});
    const Eigen::Matrix4d root = Eigen::Matrix4d::NullaryExpr([&] { return spread(random); });
    track.covariance = root * root.transpose();
    track.first_seen = {kTracked.ns - 2'000'000'000};
    track.last_seen = {kTracked.ns - (i % 3) * 200'000'000};
    people.tracks.push_back(track);
  }
  return people;
}

class PredictorConformance : public testing::TestWithParam<PredictorCase> {
 protected:
  static constexpr double kHorizon_s = 6.0;

  [[nodiscard]] Result<Prediction> predict(const Tracks& tracks, double horizon_s = kHorizon_s,
                                           bool with_all = true) {
    const BallField field({{{2.0, 0.0, 0.9}, 1.0}, {{-3.0, 2.0, 0.9}, 1.0}});
    const RobotFootprint robot{{0.0, 1.0}, {0.3, 0.0}, 0.4};
    PredictionRequest request{tracks, horizon_s};
    if (with_all) {
      request.field = &field;
      request.robot = &robot;
    }
    return predictor_->predict(request);
  }

  void expect_conforms(const Tracks& tracks, const Result<Prediction>& prediction,
                       double horizon_s = kHorizon_s) const {
    ASSERT_TRUE(prediction) << prediction.error().describe();
    EXPECT_EQ(prediction->stamp(), tracks.stamp);
    if (predictor_->subject() == PredictionSubject::kNothing) {
      EXPECT_TRUE(prediction->sets().empty());
    }
    if (predictor_->subject() != PredictionSubject::kTracks) return;
    std::map<std::int64_t, double> likelihoods;
    for (const PredictedSet& set : prediction->sets()) {
      likelihoods[set.track] += set.likelihood;
      EXPECT_LE(set.knots.front().time_s, 0.0) << "track " << set.track;
      EXPECT_GE(set.knots.back().time_s, horizon_s - 1e-9) << "track " << set.track;
      for (const PredictedSet::Knot& knot : set.knots) {
        EXPECT_TRUE(std::isfinite(knot.radius_m) && knot.centre_m.allFinite());
      }
    }
    EXPECT_EQ(likelihoods.size(), tracks.tracks.size()) << "sets of things that are not tracked";
    for (const Track& track : tracks.tracks) {
      EXPECT_GT(likelihoods[track.id], 0.0) << "track " << track.id << " has no set";
      EXPECT_LE(likelihoods[track.id], 1.0 + 1e-9) << "track " << track.id;
    }
  }

  /// With and without field and robot.
  void expect_conforms(const Tracks& tracks) {
    expect_conforms(tracks, predict(tracks));
    expect_conforms(tracks, predict(tracks, kHorizon_s, false));
  }

  std::shared_ptr<Predictor> predictor_ = GetParam().make();
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(PredictorConformance);

TEST_P(PredictorConformance, CoversEveryTrackUntilTheHorizon) {
  for (const unsigned seed : {1U, 2U, 3U}) expect_conforms(walking_people(12, seed));
}

TEST_P(PredictorConformance, TakesAnyHorizon) {
  const Tracks people = walking_people(5, 5);
  for (const double horizon_s : {0.0, 0.01, 0.25, 1.1, 30.0}) {
    SCOPED_TRACE(horizon_s);
    expect_conforms(people, predict(people, horizon_s), horizon_s);
  }
}

TEST_P(PredictorConformance, RepeatsItself) {
  const Tracks people = walking_people(12, 6);
  const auto first = predict(people);
  const auto second = predict(people);
  predictor_ = GetParam().make();
  const auto third = predict(people);
  ASSERT_TRUE(first && second && third);
  for (const auto* other : {&second, &third}) {
    ASSERT_EQ((*other)->sets().size(), first->sets().size());
    for (std::size_t i = 0; i < first->sets().size(); ++i) {
      const PredictedSet &a = first->sets()[i], &b = (*other)->sets()[i];
      EXPECT_EQ(a.track, b.track);
      EXPECT_EQ(a.likelihood, b.likelihood);
      ASSERT_EQ(a.knots.size(), b.knots.size());
      for (std::size_t k = 0; k < a.knots.size(); ++k) {
        EXPECT_EQ(a.knots[k].time_s, b.knots[k].time_s);
        EXPECT_EQ(a.knots[k].centre_m, b.knots[k].centre_m);
        EXPECT_EQ(a.knots[k].radius_m, b.knots[k].radius_m);
      }
    }
  }
}

TEST_P(PredictorConformance, HasNothingToSayOfNoTracks) {
  const Tracks nobody{{}, kTracked};
  const auto prediction = predict(nobody);
  expect_conforms(nobody, prediction);
  if (prediction && predictor_->subject() == PredictionSubject::kTracks) {
    EXPECT_TRUE(prediction->sets().empty());
  }
}

TEST_P(PredictorConformance, TakesAnyCovariance) {
  Tracks people{{}, kTracked};
  for (const double scale : {0.0, 1e-300, 1e-12, 1.0, 1e6, 1e12}) {
    Track track = track_at(static_cast<std::int64_t>(people.tracks.size()), {0.5, 1.0}, {1.0, 0.2});
    track.covariance = scale * Eigen::Matrix4d::Identity();
    people.tracks.push_back(track);
    // Of rank 1, and so not quite positive semidefinite to rounding.
    const Eigen::Vector4d along(1.0, -0.3, 0.7, 0.1);
    track.id += 100;
    track.covariance = scale * along * along.transpose();
    people.tracks.push_back(track);
  }
  expect_conforms(people);
}

TEST_P(PredictorConformance, TakesAnySpeedAndSize) {
  Tracks people{{}, kTracked};
  for (const double speed_mps : {0.0, 1e-12, 1.5, 50.0, 1e4}) {
    Track track = track_at(static_cast<std::int64_t>(people.tracks.size()), {0.0, -1.0},
                           {0.6 * speed_mps, 0.8 * speed_mps});
    people.tracks.push_back(track);
    track.id += 100;
    track.radius_m = 0.0;
    track.top_m = track.bottom_m;
    people.tracks.push_back(track);
  }
  expect_conforms(people);
}

TEST_P(PredictorConformance, TakesTracksAtOnePlace) {
  Tracks people{{}, kTracked};
  for (int i = 0; i < 4; ++i) people.tracks.push_back(track_at(i, {2.0, 0.0}, {0.0, 0.0}));
  expect_conforms(people);  // within a ball of the field, too
}

}  // namespace sidestep::conformance
