#include <deque>
#include <functional>
#include <stdexcept>

#include <gtest/gtest.h>

#include <sidestep/runtime/pipeline.hpp>

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
    update.sequence = ++sequence_;
    update.grid_moved = frame.sequence == 1000;
    return update;
  }
  const GridSpec& grid() const noexcept override { return grid_; }

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

}  // namespace
}  // namespace sidestep
