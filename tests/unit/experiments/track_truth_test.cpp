#include <sidestep/measures/track_truth.hpp>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

/// A person who walks along x at 1 m/s for 20 s; a wall that slides; a thing that stands.
Scene make_scene() {
  const auto at = [](double x_m, double y_m) {
    Transform pose = Transform::Identity();
    pose.translation() = Eigen::Vector3d(x_m, y_m, 0.85);
    return pose;
  };
  return Scene(
      {{"wall", Box{{0.1, 3.0, 2.0}}, {{0.0, at(0.0, 9.0)}, {20.0, at(9.0, 9.0)}}, false, {}},
       {"person", Cylinder{0.25, 1.7}, {{0.0, at(0.0, 0.0)}, {20.0, at(20.0, 0.0)}}, false, {}},
       {"pillar", Cylinder{0.25, 1.7}, {{0.0, at(0.0, 5.0)}}, false, {}}});
}
constexpr std::size_t kPerson = 1;

Track track_at(std::int64_t id, double x_m, double y_m, double vx_mps) {
  Track track;
  track.id = id;
  track.position_m = {x_m, y_m};
  track.velocity_mps = {vx_mps, 0.0};
  return track;
}

TEST(TrackTruth, CountsFramesDelaysIdsAndErrors) {
  const Scene scene = make_scene();
  TrackTruth truth(scene);
  for (int frame = 0; frame < 100; ++frame) {
    const double time_s = 0.1 * frame;
    Tracks tracks;
    tracks.stamp = Stamp::from_seconds(time_s);
    // From 0.5 s on, 0.1 m beside it; lost for four frames, after which it has another id.
    const bool is_lost = frame >= 50 && frame < 54;
    if (frame >= 5 && !is_lost) {
      tracks.tracks.push_back(track_at(frame < 50 ? 7 : 9, time_s, 0.1, 1.2));
    }
    if (frame == 30) tracks.tracks.push_back(track_at(8, 2.0, 5.0, 0.0));  // the pillar
    truth.observe(tracks, std::vector{kPerson});
  }
  const TrackRecord record = truth.finish();
  EXPECT_EQ(record.due_frames, 89) << "1.1 s to 9.9 s: at 0 s it did not move yet";
  EXPECT_EQ(record.found_frames, 85);
  ASSERT_EQ(record.delay_s.size(), 1U);
  EXPECT_NEAR(record.delay_s[0], 0.4, 1e-9);
  EXPECT_EQ(record.switches, 1);
  EXPECT_EQ(record.false_tracks, 1);
  ASSERT_EQ(record.position_error_m.size(), 91U);
  for (const double error_m : record.position_error_m) EXPECT_NEAR(error_m, 0.1, 1e-9);
  for (const double error_mps : record.velocity_error_mps) EXPECT_NEAR(error_mps, 0.2, 1e-6);
}

TEST(TrackTruth, BeginsAnewWithWhoLeftTheView) {
  const Scene scene = make_scene();
  TrackTruth truth(scene);
  for (int frame = 1; frame < 100; ++frame) {
    const double time_s = 0.1 * frame;
    const bool in_view = frame < 30 || frame > 60;
    Tracks tracks;
    tracks.stamp = Stamp::from_seconds(time_s);
    if (in_view) tracks.tracks.push_back(track_at(frame < 30 ? 1 : 2, time_s, 0.0, 1.0));
    const std::vector<std::size_t> seen(in_view ? 1 : 0, kPerson);
    truth.observe(tracks, seen);
  }
  const TrackRecord record = truth.finish();
  EXPECT_EQ(record.switches, 0);
  EXPECT_EQ(record.delay_s, (std::vector<double>{0.0, 0.0}));
  EXPECT_EQ(record.false_tracks, 0);
}

TEST(TrackTruth, GivesATrackToOneOfTwo) {
  const auto at = [](double x_m, double y_m) {
    Transform pose = Transform::Identity();
    pose.translation() = Eigen::Vector3d(x_m, y_m, 0.85);
    return pose;
  };
  const Scene scene(
      {{"a", Cylinder{0.2, 1.7}, {{0.0, at(0.0, 0.0)}, {9.0, at(9.0, 0.0)}}, false, {}},
       {"b", Cylinder{0.2, 1.7}, {{0.0, at(0.0, 0.4)}, {9.0, at(9.0, 0.4)}}, false, {}}});
  TrackTruth truth(scene);
  for (int frame = 1; frame <= 40; ++frame) {
    Tracks tracks;
    tracks.stamp = Stamp::from_seconds(0.1 * frame);
    tracks.tracks.push_back(track_at(1, 0.1 * frame, 0.1, 1.0));
    truth.observe(tracks, std::vector<std::size_t>{0, 1});
  }
  const TrackRecord record = truth.finish();
  EXPECT_EQ(record.due_frames, 60);
  EXPECT_EQ(record.found_frames, 30);
  EXPECT_EQ(record.delay_s.size(), 1U);
}

}  // namespace
}  // namespace sidestep
