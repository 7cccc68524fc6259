#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/prediction.hpp>

namespace sidestep {
namespace {

constexpr double kNotFinite = std::numeric_limits<double>::quiet_NaN();

PredictedSet random_set(std::int64_t track, std::mt19937& random) {
  std::uniform_real_distribution<double> place(-2.0, 2.0), radius(0.05, 0.8), gap(0.1, 2.0);
  PredictedSet set;
  set.track = track;
  set.bottom_m = 0.3 * place(random);
  set.top_m = set.bottom_m + 2.0 * radius(random);
  double time_s = -gap(random);
  for (int k = 0; k < 4; ++k, time_s += gap(random)) {
    set.knots.push_back({time_s, {place(random), place(random)}, radius(random)});
  }
  return set;
}

struct Disc {
  Eigen::Vector2d centre_m;
  double radius_m;
};

/// Where a set is at a time; false where it is nowhere.
bool disc_at(const PredictedSet& set, double time_s, Disc& disc) {
  for (std::size_t k = 1; k < set.knots.size(); ++k) {
    const auto &a = set.knots[k - 1], &b = set.knots[k];
    if (time_s < a.time_s || time_s > b.time_s) continue;
    const double to_b = (time_s - a.time_s) / (b.time_s - a.time_s), to_a = 1.0 - to_b;
    disc = {to_a * a.centre_m + to_b * b.centre_m, to_a * a.radius_m + to_b * b.radius_m};
    return true;
  }
  return false;
}

bool is_inside(const PredictedSet& set, const Disc& disc, const Eigen::Vector3d& p) {
  return (p.head<2>() - disc.centre_m).norm() < disc.radius_m && p.z() > set.bottom_m &&
         p.z() < set.top_m;
}

/// Points of the surface of an upright cylinder, no farther than `spacing_m` from the next.
std::vector<Eigen::Vector3d> surface(const PredictedSet& set, const Disc& disc, double spacing_m) {
  std::vector<Eigen::Vector3d> points;
  const int turns = static_cast<int>(6.3 * disc.radius_m / spacing_m) + 8;
  const int heights = static_cast<int>((set.top_m - set.bottom_m) / spacing_m) + 2;
  const int rings = static_cast<int>(disc.radius_m / spacing_m) + 2;
  for (int i = 0; i < turns; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / turns;
    const Eigen::Vector2d out(std::cos(angle), std::sin(angle));
    const auto add = [&](double radius_m, double z_m) {
      const Eigen::Vector2d p = disc.centre_m + radius_m * out;
      points.emplace_back(p.x(), p.y(), z_m);
    };
    for (int h = 0; h <= heights; ++h) {
      add(disc.radius_m, set.bottom_m + (set.top_m - set.bottom_m) * h / heights);
    }
    for (int r = 0; r < rings; ++r) {
      add(disc.radius_m * r / rings, set.bottom_m);
      add(disc.radius_m * r / rings, set.top_m);
    }
  }
  return points;
}

double distance_m(const Prediction& prediction, double time_s, const Eigen::Vector3d& p) {
  double distance = 0.0;
  prediction.query(time_s, {&p, 1}, {&distance, 1}, {});
  return distance;
}

TEST(Prediction, IsTheDistanceToTheNearestPointOfASurface) {
  constexpr double kSpacing_m = 0.02;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-3.0, 3.0), time(-2.5, 5.0);
  int outside = 0, inside = 0, nowhere = 0;
  for (int i = 0; i < 120; ++i) {
    const PredictedSet set = random_set(7, random);
    const auto prediction = Prediction::create({}, {set});
    ASSERT_TRUE(prediction) << prediction.error().describe();
    const double time_s = time(random);
    Disc disc;
    const bool exists = disc_at(set, time_s, disc);
    const auto points = exists ? surface(set, disc, kSpacing_m) : std::vector<Eigen::Vector3d>{};
    for (int j = 0; j < 6; ++j) {
      Eigen::Vector3d p(place(random), place(random), place(random));
      if (j % 2 == 0 && exists) {
        p << disc.centre_m + 0.4 * disc.radius_m * Eigen::Vector2d(1.0, -0.8).normalized(),
            set.bottom_m + 0.1 * (j + 1) * (set.top_m - set.bottom_m);
      }
      const double told_m = distance_m(*prediction, time_s, p);
      if (!exists) {
        EXPECT_EQ(told_m, std::numeric_limits<double>::infinity());
        ++nowhere;
        continue;
      }
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector3d& q : points) nearest_m = std::min(nearest_m, (p - q).norm());
      const bool in = is_inside(set, disc, p);
      ++(in ? inside : outside);
      EXPECT_EQ(told_m < 0.0, in);
      EXPECT_LE(std::abs(told_m), nearest_m + 1e-9);
      EXPECT_GE(std::abs(told_m), nearest_m - kSpacing_m);
    }
  }
  EXPECT_GT(outside, 100);
  EXPECT_GT(inside, 100);
  EXPECT_GT(nowhere, 50);
}

TEST(Prediction, IsThatOfTheNearestOfSeveralSets) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(-3.0, 3.0), time(-1.0, 4.0);
  std::vector<PredictedSet> sets;
  for (int i = 0; i < 9; ++i) sets.push_back(random_set(i / 2, random));
  const auto all = Prediction::create({5}, sets);
  ASSERT_TRUE(all) << all.error().describe();
  EXPECT_EQ(all->stamp(), Stamp{5});
  double last_s = 0.0;
  for (const PredictedSet& set : sets) last_s = std::max(last_s, set.knots.back().time_s);
  EXPECT_EQ(all->end_s(), last_s);
  std::vector<Eigen::Vector3d> points(50), gradients(50);
  std::vector<double> distances(50);
  for (int i = 0; i < 40; ++i) {
    for (Eigen::Vector3d& p : points) p = {place(random), place(random), place(random)};
    const double time_s = time(random);
    all->query(time_s, points, distances, gradients);
    for (std::size_t k = 0; k < points.size(); ++k) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const PredictedSet& set : sets) {
        nearest =
            std::min(nearest, distance_m(Prediction::create({}, {set}).value(), time_s, points[k]));
      }
      EXPECT_EQ(distances[k], nearest);
    }
  }
}

TEST(Prediction, HasTheGradientsOfItsDistances) {
  constexpr double kStep_m = 1e-6;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-3.0, 3.0), time(-1.0, 4.0);
  std::vector<PredictedSet> sets;
  for (int i = 0; i < 4; ++i) sets.push_back(random_set(i, random));
  const Prediction prediction = Prediction::create({}, sets).value();
  int compared = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p(place(random), place(random), place(random));
    const double time_s = time(random);
    double at = 0.0;
    Eigen::Vector3d gradient;
    prediction.query(time_s, {&p, 1}, {&at, 1}, {&gradient, 1});
    if (std::isinf(at)) {
      EXPECT_EQ(gradient, Eigen::Vector3d::Zero().eval());
      continue;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep_m * Eigen::Vector3d::Unit(axis);
      const double forward = (distance_m(prediction, time_s, p + step) - at) / kStep_m;
      const double backward = (at - distance_m(prediction, time_s, p - step)) / kStep_m;
      if (std::abs(forward - backward) > 1e-3) continue;  // another set, or side, is nearest
      EXPECT_NEAR(gradient[axis], 0.5 * (forward + backward), 1e-5);
      ++compared;
    }
  }
  EXPECT_GT(compared, 800);
}

TEST(Prediction, ComesNoFasterThanItsSpeed) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> place(-3.0, 3.0), share(0.0, 1.0);
  double fastest_share = 0.0;
  for (int i = 0; i < 300; ++i) {
    const PredictedSet set = random_set(1, random);
    const Prediction prediction = Prediction::create({}, {set}).value();
    const double begin_s = set.knots.front().time_s, end_s = set.knots.back().time_s;
    for (int j = 0; j < 20; ++j) {
      const Eigen::Vector3d p(place(random), place(random), place(random));
      const double from_s = begin_s + 0.99 * share(random) * (end_s - begin_s);
      const double dt_s = std::min(0.05 * share(random) + 1e-3, end_s - from_s);
      const double fallen_m =
          distance_m(prediction, from_s, p) - distance_m(prediction, from_s + dt_s, p);
      EXPECT_LE(fallen_m, prediction.speed_mps() * dt_s + 1e-9);
      fastest_share = std::max(fastest_share, fallen_m / (prediction.speed_mps() * dt_s));
    }
  }
  EXPECT_GT(fastest_share, 0.9);  // and the bound is not idle
}

TEST(Prediction, NamesTheTrackOfASetThatMakesNoSense) {
  const auto refused = [](auto change, const std::string& words) {
    PredictedSet set;
    set.track = 42;
    set.top_m = 1.8;
    set.knots = {{0.0, {0.0, 0.0}, 0.3}, {1.0, {1.0, 0.0}, 0.3}};
    ASSERT_TRUE(Prediction::create({}, {set}));
    change(set);
    const auto prediction = Prediction::create({}, {set});
    ASSERT_FALSE(prediction) << words;
    EXPECT_EQ(prediction.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(prediction.error().message.find("track 42"), std::string::npos);
    EXPECT_NE(prediction.error().message.find(words), std::string::npos)
        << prediction.error().message;
  };
  refused([](PredictedSet& set) { set.knots[1].centre_m.x() = kNotFinite; }, "not finite");
  refused([](PredictedSet& set) { set.knots[1].radius_m = INFINITY; }, "not finite");
  refused([](PredictedSet& set) { set.knots[0].time_s = kNotFinite; }, "not finite");
  refused([](PredictedSet& set) { set.knots[0].radius_m = -0.1; }, "negative radius");
  refused([](PredictedSet& set) { set.knots[1].time_s = 0.0; }, "out of order");
  refused([](PredictedSet& set) { set.knots.clear(); }, "no knots");
  refused([](PredictedSet& set) { set.top_m = -1.0; }, "height");
  refused([](PredictedSet& set) { set.likelihood = 0.0; }, "likelihood");
  refused([](PredictedSet& set) { set.likelihood = 1.1; }, "likelihood");
  refused([](PredictedSet& set) { set.likelihood = kNotFinite; }, "likelihood");
}

TEST(WorstCasePrediction, NamesATrackThatIsNotFinite) {
  Track track;
  track.id = 11;
  for (double* const number : {&track.position_m.x(), &track.radius_m, &track.covariance(1, 1)}) {
    const double before = std::exchange(*number, kNotFinite);
    const auto prediction = worst_case_prediction({{track}, {}}, 1.6, 3.0);
    ASSERT_FALSE(prediction);
    EXPECT_NE(prediction.error().message.find("track 11"), std::string::npos);
    *number = before;
  }
}

}  // namespace
}  // namespace sidestep
