#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <stop_token>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/sensing/source.hpp>

#include "manual_clock.hpp"

/// What every Source must hold. In a test of your own:
///
///     INSTANTIATE_TEST_SUITE_P(mine, SourceConformance,
///                              testing::Values(SourceCase{"mine", [](const Clock&) { return
///                              make_mine(); }}));
namespace sidestep::conformance {

struct SourceCase {
  std::string name;
  /// A new one at the beginning of its stream, of two or more good frames that measure something.
  /// The run's clock, which outlives it, stands but while a frame of a live source is awaited.
  std::function<std::shared_ptr<Source>(const Clock&)> make;
  bool is_live = false;  ///< Frames come in time or not at all, and are not the same again.
  /// Where it offers GroundTruth: most of what it measures is no farther from the scene.
  double truth_error_m = 0.02;

  friend std::ostream& operator<<(std::ostream& out, const SourceCase& c) { return out << c.name; }
};

/// What a frame measured, in the optical frame.
[[nodiscard]] inline std::vector<Eigen::Vector3d> measured_points_m(const Frame& frame) {
  std::vector<Eigen::Vector3d> points_m;
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    for (int v = 0; v < image->camera.height_px; ++v) {
      for (int u = 0; u < image->camera.width_px; ++u) {
        const auto depth_m = static_cast<double>(image->at(u, v));
        if (depth_m > 0.0) points_m.push_back(image->camera.unproject(u, v, depth_m));
      }
    }
  } else {
    for (const Eigen::Vector3f& p : std::get<PointCloud>(frame.measurement).points_m) {
      if (p.allFinite() && !p.isZero()) points_m.push_back(p.cast<double>());
    }
  }
  return points_m;
}

/// The numbers of a frame, one after the other.
[[nodiscard]] inline std::vector<double> numbers_of(const Frame& frame) {
  const Eigen::Matrix4d T = frame.T_world_camera.matrix();
  std::vector<double> numbers(T.data(), T.data() + T.size());
  const auto add = [&](const auto&... values) {
    (numbers.push_back(static_cast<double>(values)), ...);
  };
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    const CameraIntrinsics& c = image->camera;
    add(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px);
    for (const float depth_m : image->depth_m) add(depth_m);
  } else {
    for (const auto& p : std::get<PointCloud>(frame.measurement).points_m) add(p.x(), p.y(), p.z());
  }
  if (frame.joint_positions) {
    for (const double position : *frame.joint_positions) add(position);
  }
  return numbers;
}

class SourceConformance : public testing::TestWithParam<SourceCase> {
 protected:
  using Next = Result<std::optional<Frame>>;
  struct Reading {
    std::vector<std::optional<Frame>> frames;  ///< Nothing for one that is bad.
    bool has_ended = false;

    [[nodiscard]] std::vector<const Frame*> good() const {
      std::vector<const Frame*> good;
      for (const auto& frame : frames) {
        if (frame) good.push_back(&*frame);
      }
      return good;
    }
  };

  void SetUp() override { ASSERT_NE(source_, nullptr); }

  [[nodiscard]] static bool is_late(const Next& next) {
    return !next && next.error().code == ErrorCode::kDeadlineExceeded;
  }
  /// The next one; the clock goes on for as long as a live source has none.
  Next await(Source& source) {
    if (!GetParam().is_live) return source.next(Deadline());
    constexpr int kPatience = 10'000;
    Next next = source.next(Deadline::after_s(0.001));
    for (int i = 0; is_late(next) && i < kPatience; ++i) {
      clock_.advance_s(0.01);
      next = source.next(Deadline::after_s(0.001));
    }
    return next;
  }
  /// What it says while there is nothing to wait for.
  static Next at_once(Source& source, const Deadline& deadline) {
    constexpr double kReading_ms = 2000.0;  // of a frame, if it reads one
    const Stopwatch watch;
    Next next = source.next(deadline);
    EXPECT_LT(watch.elapsed_ms(), kReading_ms) << "it was to return at once";
    return next;
  }
  /// To its end or 50 frames; `in_haste`: each is asked for without any time first.
  Reading read(Source& source, bool in_haste = false) {
    constexpr std::size_t kMost = 50;
    Reading reading;
    while (reading.frames.size() < kMost) {
      Next next = in_haste ? at_once(source, Deadline::after_s(0.0)) : await(source);
      if (in_haste && is_late(next)) next = await(source);
      if (next && !*next) {
        reading.has_ended = true;
        break;
      }
      if (next) {
        reading.frames.push_back(std::move(*next));
        continue;
      }
      reading.frames.emplace_back();
      EXPECT_FALSE(next.error().message.empty() || next.error().where.empty())
          << "an error has to name file and frame: " << next.error().describe();
      if (next.error().code == ErrorCode::kBadFrame) continue;
      ADD_FAILURE() << "it fails for good: " << next.error().describe();
      break;
    }
    return reading;
  }
  static void expect_same(const Reading& one, const Reading& other) {
    ASSERT_EQ(one.frames.size(), other.frames.size());
    EXPECT_EQ(one.has_ended, other.has_ended);
    for (std::size_t i = 0; i < one.frames.size(); ++i) {
      SCOPED_TRACE("frame " + std::to_string(i));
      const auto &a = one.frames[i], &b = other.frames[i];
      ASSERT_EQ(a.has_value(), b.has_value()) << "one is bad";
      if (!a) continue;
      EXPECT_EQ(a->sequence, b->sequence);
      EXPECT_EQ(a->stamp.ns, b->stamp.ns);
      ASSERT_EQ(a->measurement.index(), b->measurement.index());
      const auto is_same = [](double x, double y) {
        return x == y || (std::isnan(x) && std::isnan(y));
      };
      ASSERT_TRUE(std::ranges::equal(numbers_of(*a), numbers_of(*b), is_same));
    }
  }

  ManualClock clock_;
  std::shared_ptr<Source> source_ = GetParam().make(clock_);
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SourceConformance);

TEST_P(SourceConformance, HandsOutFramesThatMeasureSomething) {
  const Reading reading = read(*source_);
  ASSERT_GE(reading.good().size(), 2U);
  std::size_t points = 0;
  for (const Frame* frame : reading.good()) {
    SCOPED_TRACE("frame " + std::to_string(frame->sequence));
    ASSERT_TRUE(frame->T_world_camera.matrix().allFinite());
    const Eigen::Matrix3d R = frame->T_world_camera.linear();
    EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-5) << R;
    EXPECT_GT(R.determinant(), 0.0) << "it mirrors";
    if (const auto* image = std::get_if<DepthImage>(&frame->measurement)) {
      const CameraIntrinsics& c = image->camera;
      ASSERT_GT(std::min(c.width_px, c.height_px), 0);
      EXPECT_TRUE(c.fx_px > 0.0 && c.fy_px > 0.0 && std::isfinite(c.fx_px * c.fy_px));
      EXPECT_TRUE(std::isfinite(c.cx_px) && std::isfinite(c.cy_px));
      ASSERT_EQ(image->depth_m.size(),
                static_cast<std::size_t>(c.width_px) * static_cast<std::size_t>(c.height_px));
      for (const float depth_m : image->depth_m) {
        ASSERT_TRUE(std::isnan(depth_m) || (depth_m >= 0.0F && !std::isinf(depth_m))) << depth_m;
      }
    } else {
      for (const auto& p : std::get<PointCloud>(frame->measurement).points_m) {
        ASSERT_FALSE(p.array().isInf().any()) << p.transpose();
      }
    }
    points += measured_points_m(*frame).size();
  }
  EXPECT_GT(points, 0U);
}

TEST_P(SourceConformance, NumbersAndStampsAscend) {
  const Reading reading = read(*source_);
  const auto frames = reading.good();
  for (std::size_t i = 1; i < frames.size(); ++i) {
    EXPECT_LT(frames[i - 1]->sequence, frames[i]->sequence);
    EXPECT_LT(frames[i - 1]->stamp.ns, frames[i]->stamp.ns) << "frame " << frames[i]->sequence;
  }
}

TEST_P(SourceConformance, JointPositionsAreThoseOfOneRobot) {
  const Reading reading = read(*source_);
  std::optional<Eigen::Index> joints;
  for (const Frame* frame : reading.good()) {
    if (!frame->joint_positions) continue;
    EXPECT_TRUE(frame->joint_positions->allFinite()) << "frame " << frame->sequence;
    if (!joints) joints = frame->joint_positions->size();
    EXPECT_EQ(frame->joint_positions->size(), *joints) << "frame " << frame->sequence;
    EXPECT_GT(*joints, 0);
  }
  if (!joints) GTEST_SKIP() << "tells of no robot";
}

TEST_P(SourceConformance, KnowsTheirNumberOrDoesNotTell) {
  const auto count = source_->frame_count();
  if (!count) GTEST_SKIP() << "does not tell";
  const Reading reading = read(*source_);
  const auto seen = static_cast<std::int64_t>(reading.frames.size());
  EXPECT_GE(*count, seen);
  if (reading.has_ended && !GetParam().is_live) {
    EXPECT_EQ(*count, seen) << "bad frames included";
  }
  EXPECT_EQ(source_->frame_count(), count) << "of all, not of those to come";
}

TEST_P(SourceConformance, StaysAtItsEnd) {
  if (!read(*source_).has_ended) GTEST_SKIP() << "does not end soon";
  for (const double time_s : {0.0, 0.01, 0.0}) {
    clock_.advance_s(1.0);
    const Next next = source_->next(Deadline::after_s(time_s));
    EXPECT_TRUE(is_late(next) || (next && !*next)) << "it goes on behind its end";
  }
  const Next next = source_->next(Deadline());
  EXPECT_TRUE(next && !*next);
}

TEST_P(SourceConformance, HandsOutTheSameAgain) {
  if (GetParam().is_live) GTEST_SKIP() << "is live";
  const auto other = GetParam().make(clock_);
  expect_same(read(*source_), read(*other));
}

TEST_P(SourceConformance, LosesNothingForWantOfTime) {
  const Reading in_haste = read(*source_, true);
  EXPECT_GE(in_haste.good().size(), 2U);
  if (!GetParam().is_live) expect_same(in_haste, read(*GetParam().make(clock_)));
}

TEST_P(SourceConformance, ReturnsWhenItIsToStop) {
  constexpr double kForLong_s = 10.0;
  const auto stops = [](const Next& next) {
    return next || is_late(next) || next.error().code == ErrorCode::kCancelled ||
           next.error().code == ErrorCode::kBadFrame;
  };
  (void)await(*source_);  // a live one has no other before the clock goes on
  std::stop_source stop;
  {
    const std::jthread other([&] { stop.request_stop(); });
    EXPECT_TRUE(stops(at_once(*source_, Deadline::after_s(kForLong_s, stop.get_token()))));
  }
  EXPECT_TRUE(stops(at_once(*source_, Deadline::after_s(kForLong_s, stop.get_token()))));
}

TEST_P(SourceConformance, MeasuresTheSceneThatItTellsOf) {
  auto* const truth = dynamic_cast<GroundTruth*>(source_.get());
  if (truth == nullptr) GTEST_SKIP() << "offers no GroundTruth";
  EXPECT_FALSE(truth->scene().objects().empty());
  const Reading reading = read(*source_);
  for (const Frame* frame : reading.good()) {
    const auto scene = truth->scene_until(frame->stamp);
    ASSERT_NE(scene, nullptr);
    const auto points_m = measured_points_m(*frame);
    if (points_m.empty()) continue;
    std::vector<double> off_m;
    for (std::size_t i = 0; i < points_m.size(); i += 1 + points_m.size() / 200) {
      const Eigen::Vector3d p_world = frame->T_world_camera * points_m[i];
      off_m.push_back(std::abs(scene->signed_distance(p_world, frame->stamp.seconds()).distance_m));
    }
    std::ranges::sort(off_m);
    EXPECT_LE(off_m[off_m.size() / 2], GetParam().truth_error_m) << "frame " << frame->sequence;
  }
}

}  // namespace sidestep::conformance
