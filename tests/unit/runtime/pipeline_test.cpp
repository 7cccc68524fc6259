#include <bit>
#include <cmath>
#include <deque>
#include <functional>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/pipeline.hpp>

#include "conformance/grid_map.hpp"
#include "conformance/localiser_conformance.hpp"
#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using conformance::RecordingLog;

/// Hands out what a test put in; the end of the stream after that.
class ScriptedSource final : public Source {
 public:
  Result<std::optional<Frame>> next(const Deadline&) override {
    if (script.empty()) return std::optional<Frame>{};
    if (on_next) on_next();
    auto result = std::move(script.front());
    script.pop_front();
    if (!result && result.error().message == "throw") throw std::runtime_error("unplugged");
    return result;
  }
  std::optional<std::int64_t> frame_count() const override { return std::nullopt; }

  void add_frame(std::int64_t sequence) {
    Frame frame;
    frame.sequence = sequence;
    script.emplace_back(std::optional<Frame>(std::move(frame)));
  }
  void add_error(ErrorCode code, std::string message) {
    script.emplace_back(fail(code, std::move(message)));
  }

  std::deque<Result<std::optional<Frame>>> script;
  std::function<void()> on_next;
};

class CountingMapper final : public Mapper {
 public:
  Result<MapUpdate> integrate(const Frame& frame) override {
    if (frame.sequence < 0) return fail(ErrorCode::kBadFrame, "negative");
    MapUpdate update;
    sequence_ += skips ? 2 : 1;
    update.sequence = sequence_;
    update.stamp = frame.stamp;
    update.grid_moved = frame.sequence == 1000;
    return update;
  }
  const GridSpec& grid() const noexcept override { return grid_; }

  bool skips = false;

 private:
  GridSpec grid_;
  std::int64_t sequence_ = 0;
};

class EmptyField final : public DistanceField {
 public:
  using DistanceField::DistanceField;
  void query(std::span<const Eigen::Vector3d>, std::span<double>, std::span<Eigen::Vector3d>,
             std::span<FieldStatus>) const noexcept override {}
};

class NumberingBuilder final : public FieldBuilder {
 public:
  bool forgetful = false;
  int attached = 0;
  bool attaches = true;

  Result<void> attach(Mapper&) override {
    ++attached;
    if (!attaches) return fail(ErrorCode::kUnsupported, "too far");
    return {};
  }
  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (forgetful) return nullptr;
    return std::make_shared<EmptyField>(FieldInfo{.sequence = update.sequence});
  }
};

class Pipeline : public testing::Test {
 protected:
  ScriptedSource source_;
  CountingMapper mapper_;
  NumberingBuilder builder_;
  SnapshotSlot slot_;
  RecordingLog log_;
  MappingPipeline pipeline_{{source_, mapper_, builder_, slot_, log_}};
};

TEST_F(Pipeline, PublishesAFieldForEveryFrameUntilTheEnd) {
  source_.add_frame(10);
  source_.add_frame(11);
  ASSERT_TRUE(pipeline_.attach());
  EXPECT_EQ(pipeline_.step({}).value()->frame_sequence, 10);
  EXPECT_EQ(slot_.pin()->info().sequence, 1);
  EXPECT_EQ(pipeline_.step({}).value()->frame_sequence, 11);
  EXPECT_EQ(slot_.pin()->info().sequence, 2);
  EXPECT_FALSE(pipeline_.step({}).value().has_value());
}

/// Says that odometry is a metre behind, and keeps the field that it was given.
class MetreAhead final : public Localiser {
 public:
  Result<Localisation> localise(const Frame&, const DistanceField* field) override {
    fields.push_back(field != nullptr ? field->info().sequence : 0);
    if (fails) return fail(ErrorCode::kIo, "no light");
    Localisation found;
    found.T_map_odom.translation().x() = x_m;
    return found;
  }
  std::vector<std::int64_t> fields;
  double x_m = 1.0;
  bool fails = false;
};

TEST_F(Pipeline, MapsFramesWhereALocaliserHasThem) {
  MetreAhead localiser;
  MappingPipeline pipeline({.source = source_,
                            .mapper = mapper_,
                            .field_builder = builder_,
                            .slot = slot_,
                            .log = log_,
                            .names = {.localiser = "localiser ahead"},
                            .localiser = &localiser});
  ASSERT_TRUE(pipeline.attach());
  Frame image;
  image.measurement = DepthImage{{1, 1, 1.0, 1.0, 0.0, 0.0}, {1.0F}};
  for (int i = 0; i < 6; ++i) source_.script.emplace_back(std::optional<Frame>(image));
  const auto step = pipeline.step({});
  ASSERT_TRUE(step && *step);
  EXPECT_EQ((*step)->localisation->T_map_odom.translation().x(), 1.0);
  EXPECT_EQ(slot_.snapshot().localisation->T_map_odom.translation().x(), 1.0);
  EXPECT_EQ(slot_.snapshot().camera->T_world_camera.translation().x(), 1.0);
  ASSERT_TRUE(pipeline.step({}));
  EXPECT_THAT(localiser.fields, testing::ElementsAre(0, 1));
  Frame broken = image;
  broken.measurement = DepthImage{{2, 2, 1.0, 1.0, 0.5, 0.5}, {1.0F}};
  source_.script.emplace_front(std::optional<Frame>(broken));
  ASSERT_TRUE(pipeline.step({}));
  EXPECT_EQ(localiser.fields.size(), 3u);
  EXPECT_EQ(pipeline.bad_frames().size(), 1u);
  localiser.x_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(pipeline.step({}).error().describe(), testing::HasSubstr("localiser ahead"));
  localiser.fails = true;
  EXPECT_THAT(pipeline.step({}).error().describe(), testing::HasSubstr("no light"));
}

TEST_F(Pipeline, MovesTheJointsOfABaseWithItsFrame) {
  const auto base = BaseJoints::of(*conformance::turning_robot());
  Frame frame;
  frame.joint_positions = Eigen::Vector3d(1.0, 0.0, 0.1);
  move_frame(frame, transform_from_xyz_rpy({0.0, 2.0, 0.0}, {0.0, 0.0, 0.5}), *base);
  const Eigen::Vector3d moved(std::cos(0.5), 2.0 + std::sin(0.5), 0.6);
  EXPECT_TRUE(frame.joint_positions->isApprox(moved)) << *frame.joint_positions;
}

TEST_F(Pipeline, SkipsUnusableFramesOfSourceAndMapperAndKeepsTheReasons) {
  source_.add_error(ErrorCode::kBadFrame, "truncated");
  source_.add_frame(-1);
  source_.add_frame(3);
  const auto step = pipeline_.step({});
  ASSERT_TRUE(step && *step);
  EXPECT_EQ((*step)->frame_sequence, 3);
  EXPECT_EQ(slot_.pin()->info().sequence, 1);
  ASSERT_EQ(pipeline_.bad_frames().size(), 2u);
  EXPECT_EQ(pipeline_.bad_frames()[0].message, "truncated");
  EXPECT_EQ(pipeline_.bad_frames()[1].message, "negative");
  EXPECT_EQ(pipeline_.take_bad_frames().size(), 2u);
  EXPECT_TRUE(pipeline_.bad_frames().empty());
  EXPECT_EQ(log_.messages().size(), 2u);
}

TEST_F(Pipeline, EndsOnAnythingElse) {
  source_.add_error(ErrorCode::kIo, "disk gone");
  const auto step = pipeline_.step({});
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().message, "disk gone");
}

TEST_F(Pipeline, AttachesTheBuilderAgainWhereTheGridMoved) {
  ASSERT_TRUE(pipeline_.attach());
  source_.add_frame(1);
  source_.add_frame(1000);
  ASSERT_TRUE(pipeline_.step({}));
  EXPECT_EQ(builder_.attached, 1);
  ASSERT_TRUE(pipeline_.step({}));
  EXPECT_EQ(builder_.attached, 2);
  EXPECT_EQ(slot_.pin()->info().sequence, 2);
  builder_.attaches = false;
  source_.add_frame(1000);
  const auto step = pipeline_.step({});
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().message, "too far");
}

TEST_F(Pipeline, AnExceptionBecomesAnErrorThatNamesThePart) {
  source_.add_error(ErrorCode::kInternal, "throw");
  const auto step = pipeline_.step({});
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().code, ErrorCode::kPlugin);
  EXPECT_EQ(step.error().describe(), "plugin source: threw: unplugged");
}

TEST_F(Pipeline, AFieldThatIsNotThereIsNeverPublished) {
  source_.add_frame(1);
  source_.add_frame(2);
  ASSERT_TRUE(pipeline_.step({}));
  builder_.forgetful = true;
  const auto step = pipeline_.step({});
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().describe(), "plugin field: returned no field");
  ASSERT_NE(slot_.pin(), nullptr);
  EXPECT_EQ(slot_.pin()->info().sequence, 1);
}

TEST_F(Pipeline, SkippingEndsAtTheDeadlineThoughTheSourceDoesNotWatchIt) {
  std::stop_source stop;
  for (int i = 0; i < 10; ++i) source_.add_error(ErrorCode::kBadFrame, "truncated");
  source_.on_next = [&] {
    if (source_.script.size() == 8) stop.request_stop();
  };
  const auto step = pipeline_.step(Deadline(stop.get_token()));
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(pipeline_.bad_frames().size(), 3u);
}

TEST_F(Pipeline, EndsWhereAMapperBreaksItsPromises) {
  source_.add_frame(7);
  source_.add_frame(8);
  ASSERT_TRUE(pipeline_.step({}));
  mapper_.skips = true;
  const auto step = pipeline_.step({});
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().code, ErrorCode::kPlugin);
  EXPECT_EQ(step.error().where, "plugin mapper, frame 8");
  EXPECT_EQ(step.error().message, "update 3 follows update 1");
}

/// A pillar that stands, and a thing of 0.4 m that goes along y at 1 m/s. Frames are its near face.
class CrossedMap final : public conformance::GridMap {
 public:
  CrossedMap() : GridMap({{0.0, -3.0, 0.0}, 0.1, {60, 60, 20}}) {
    fill({0, 0, 0}, {59, 59, 19}, false);
    fill({40, 40, 0}, {41, 41, 19}, true);
  }
  static Frame frame(int number) {
    Frame frame;
    frame.sequence = number;
    frame.stamp = Stamp::from_seconds(0.1 * number);
    PointCloud cloud;
    for (int y = -9; y <= 9; ++y) {
      for (int z = 0; z < 10; ++z) {
        const Eigen::Vector3d p(3.01, -1.45 + 0.1 * number + 0.02 * y, 0.25 + 0.1 * z);
        cloud.points_m.emplace_back(p.cast<float>());
      }
    }
    frame.measurement = std::move(cloud);
    return frame;
  }
  Result<MapUpdate> integrate(const Frame& frame) override {
    const int y = static_cast<int>(frame.sequence) + 14;
    if (frame.sequence > 0) fill({30, y - 1, 2}, {33, y + 2, 12}, false);
    fill({30, y, 2}, {33, y + 3, 12}, true);
    MapUpdate update = take_update();
    update.stamp = frame.stamp;
    return update;
  }

 private:
  void fill(const Eigen::Vector3i& low, const Eigen::Vector3i& high, bool occupied) {
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) set({x, y, z}, occupied);
      }
    }
  }
};

/// Counts the occupied voxels that it is shown.
class CountingBuilder final : public FieldBuilder {
 public:
  bool takes_masked = true;
  const OccupancyView* view = nullptr;
  std::vector<std::size_t> occupied_vox;

  Result<void> attach(Mapper& mapper) override {
    if (!takes_masked && dynamic_cast<CrossedMap*>(&mapper) == nullptr) {
      return fail(ErrorCode::kUnsupported, "wants a CrossedMap");
    }
    view = dynamic_cast<const OccupancyView*>(&mapper);
    return {};
  }
  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    std::size_t count = 0;
    for (const std::uint64_t word : view->occupied().words)
      count += static_cast<std::size_t>(std::popcount(word));
    occupied_vox.push_back(count);
    return std::make_shared<EmptyField>(FieldInfo{.sequence = update.sequence});
  }
};

class TrackingPipeline : public testing::Test {
 protected:
  void run(bool masks_tracks) {
    MappingPipeline pipeline(
        {source_, map_, builder_, slot_, log_, {}, &detector_, false, &tracker_, masks_tracks});
    ASSERT_TRUE(pipeline.attach());
    for (int number = 0; number < 20; ++number) {
      source_.script.emplace_back(std::optional<Frame>(CrossedMap::frame(number)));
      ASSERT_TRUE(pipeline.step({}));
    }
    ASSERT_TRUE(pipeline.attach()) << "again, as where a grid has moved";
  }

  static constexpr std::size_t kPillar = 2 * 2 * 20, kThing = 4 * 4 * 11;
  ScriptedSource source_;
  CrossedMap map_;
  CountingBuilder builder_;
  SnapshotSlot slot_;
  RecordingLog log_;
  MotionDetector detector_;
  Tracker tracker_;
};

TEST_F(TrackingPipeline, PublishesTracksAndShowsTheFieldEverything) {
  run(false);
  const MapSnapshot snapshot = slot_.snapshot();
  ASSERT_EQ(snapshot.tracks->tracks.size(), 1U);
  const Track& track = snapshot.tracks->tracks.front();
  EXPECT_EQ(snapshot.tracks->stamp, Stamp::from_seconds(1.9));
  EXPECT_NEAR(track.position_m.y(), -1.45 + 1.9, 0.1);
  EXPECT_NEAR(track.velocity_mps.y(), 1.0, 0.25);
  EXPECT_FALSE(snapshot.moving->balls.empty());
  for (const std::size_t count : builder_.occupied_vox) EXPECT_EQ(count, kPillar + kThing);
}

TEST_F(TrackingPipeline, HidesWhatIsTrackedFromTheField) {
  run(true);
  EXPECT_EQ(builder_.occupied_vox.front(), kPillar + kThing) << "not tracked yet";
  EXPECT_EQ(builder_.occupied_vox.back(), kPillar);
  EXPECT_FALSE(slot_.snapshot().moving->balls.empty());
  EXPECT_TRUE(log_.messages().empty());
}

TEST_F(TrackingPipeline, SaysOnceThatAFieldIsBuiltWithEverything) {
  builder_.takes_masked = false;
  run(true);
  EXPECT_EQ(builder_.occupied_vox.back(), kPillar + kThing);
  EXPECT_EQ(slot_.snapshot().tracks->tracks.size(), 1U);
  ASSERT_EQ(log_.messages().size(), 1U);
  EXPECT_EQ(log_.messages()[0],
            "field of mapper is not built without what is tracked: that takes a tracker, and a "
            "mapper and a field that share the view 'occupancy'");
}

}  // namespace
}  // namespace sidestep
