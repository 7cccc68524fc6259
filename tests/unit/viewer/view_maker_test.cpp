#include "view_feed.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "view_testing.hpp"

namespace sidestep {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;
using testing_support::ball_field;
using testing_support::ball_world;
using testing_support::DecodedMap;
using testing_support::DecodedMessage;
using testing_support::ListeningSink;
using testing_support::map_at;
using testing_support::plan_at;
using testing_support::step_at;

/// What feeds the maker, with a clock moved by hand.
class ViewMakerTest : public ::testing::Test {
 protected:
  /// Time passes, and the maker looks.
  void look(int after_ms = 0) {
    now_ += std::chrono::milliseconds(after_ms);
    if (maker_.is_wanted()) maker_.make(now_, inbox_.take());
  }
  /// All kinds of news.
  void tell(double time_s, double x_m = 0.0) {
    inbox_.mapped(map_at(time_s, static_cast<std::int64_t>(30 * time_s), ball_field({x_m, 1, 1})));
    inbox_.stepped(step_at(time_s));
  }

  ListeningSink sink_;
  ViewInbox inbox_;
  ViewMaker maker_{{&sink_}};
  ViewMaker::TimePoint now_{std::chrono::seconds(100)};
};

TEST_F(ViewMakerTest, GreetsWithTheNewestOfEachKind) {
  inbox_.begin(ball_world());
  sink_.wanted = {true, false, {}};
  tell(0.1);
  look();
  tell(0.2, 1.5);
  inbox_.happened(plan_at(0.2));
  inbox_.happened(plan_at(0.25));
  sink_.wanted.newcomers = true;
  look(1);  // Nothing is due by its rate: newcomers come first.
  std::vector<std::string> kinds;
  for (const ViewMessage& message : sink_.greeting) kinds.emplace_back(to_string(message.kind));
  EXPECT_THAT(kinds, ElementsAre("world", "map", "state", "frame", "plan", "event", "timing"));
  const DecodedMessage map(*sink_.greeting[1].bytes);
  EXPECT_EQ(map.header.at("full"), true);
  DecodedMap page;
  page.apply(map);
  EXPECT_TRUE(page.occupied(25, 5, 7)) << "the ball's place in the newest map";
  EXPECT_FALSE(page.occupied(10, 5, 7)) << "and in the one before";
  EXPECT_EQ(sink_.greeting[2].stamp, Stamp::from_seconds(0.2));
  EXPECT_EQ(sink_.greeting[4].stamp, Stamp::from_seconds(0.25));
}

TEST_F(ViewMakerTest, MakesNothingWhileNobodyReads) {
  sink_.wanted = {false, false, {}};
  inbox_.begin(ball_world());
  tell(0.1);
  look();
  EXPECT_FALSE(maker_.is_wanted());
  EXPECT_THAT(sink_.messages, IsEmpty());
  EXPECT_EQ(inbox_.take().size(), 1U) << "what came is still there";
}

TEST_F(ViewMakerTest, KeepsTheRateOfEachKind) {
  inbox_.begin(ball_world());
  tell(0.0);
  look();
  (void)sink_.take_kinds();
  std::map<std::string, int> count;
  for (int i = 1; i <= 1000; ++i) {  // 10 s, news every 10 ms
    tell(0.01 * i, 0.01 * i);
    look(10);
    for (const std::string& kind : sink_.take_kinds()) ++count[kind];
  }
  EXPECT_EQ(count["state"], 300);
  EXPECT_EQ(count["map"], 100);
  EXPECT_EQ(count["frame"], 50);
  EXPECT_EQ(count["timing"], 40);
}

TEST_F(ViewMakerTest, MakesNothingOfWhatIsNotNew) {
  inbox_.begin(ball_world());
  tell(0.0);
  look();
  (void)sink_.take_kinds();
  look(1000);
  EXPECT_THAT(sink_.take_kinds(), IsEmpty());
}

TEST_F(ViewMakerTest, LosesNoTimeOfFramesAndSteps) {
  inbox_.begin(ball_world());
  look();
  std::size_t frames = 0, steps = 0;
  for (int i = 0; i < 300; ++i) {
    tell(i / 30.0);
    look(33);
  }
  inbox_.end({});
  look(1);
  for (const ViewMessage& message : sink_.messages) {
    if (message.kind != ViewKind::kTiming) continue;
    const DecodedMessage decoded(*message.bytes);
    frames += decoded.header.at("frames").size();
    steps += decoded.header.at("steps").size();
  }
  EXPECT_EQ(frames, 300U);
  EXPECT_EQ(steps, 100U);
}

TEST_F(ViewMakerTest, MapsCarryWhatChangedSinceTheLastOne) {
  inbox_.begin(ball_world());
  look();
  DecodedMap page;
  std::vector<bool> full;
  for (int i = 0; i < 20; ++i) {
    tell(0.1 * i, 0.1 * i);
    look(100);
  }
  for (const ViewMessage& message : sink_.messages) {
    if (message.kind != ViewKind::kMap) continue;
    const DecodedMessage decoded(*message.bytes);
    full.push_back(decoded.header.at("full"));
    page.apply(decoded);
  }
  ASSERT_EQ(full.size(), 20U);
  EXPECT_EQ(std::ranges::count(full, true), 1);
  EXPECT_TRUE(full[0]);
  const auto last = ball_field({1.9, 1, 1});
  const Eigen::Vector3i size = last->info().grid.size_vox;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        ASSERT_EQ(page.occupied(x, y, z), last->at({x, y, z}) <= 0.0F);
      }
    }
  }
}

TEST_F(ViewMakerTest, AnEpisodeBeginsAnewAndEndsLast) {
  inbox_.begin(ball_world());
  tell(0.0);
  look();
  (void)sink_.take_kinds();
  tell(0.001);
  inbox_.happened(plan_at(0.001));
  inbox_.end({Stamp::from_seconds(0.002), true, "done"});
  inbox_.begin(ball_world());
  tell(0.0);
  look(1);  // Before anything is due: an end waits for none.
  const auto kinds = sink_.take_kinds();
  ASSERT_GE(kinds.size(), 8U);
  EXPECT_THAT(std::vector(kinds.begin(), kinds.begin() + 8),
              ElementsAre("event", "plan", "state", "map", "frame", "timing", "end", "world"));
  sink_.wanted.newcomers = true;
  look(1);
  for (const ViewMessage& message : sink_.greeting) {
    EXPECT_NE(message.kind, ViewKind::kEnd) << "of the episode before";
    EXPECT_NE(message.kind, ViewKind::kPlan);
  }
}

TEST_F(ViewMakerTest, TellsWhatWasRefusedAndThenWhatIsFollowed) {
  inbox_.begin(ball_world());
  look();
  (void)sink_.take_kinds();
  ObservedEvent event = plan_at(2.0);
  event.event.refused = plan_at(0.0, -3.0).followed;
  inbox_.happened(event);
  look(1);
  ASSERT_EQ(sink_.messages.size(), 3U);
  const DecodedMessage refused(*sink_.messages[1].bytes), followed(*sink_.messages[2].bytes);
  EXPECT_EQ(refused.header.at("role"), "refused");
  EXPECT_EQ(refused.header.at("start_s"), 2.0);
  const std::size_t last = refused.header.at("times_s").size() - 1;
  EXPECT_NEAR(refused.f32(3 * last), -3.0F, 1e-5F);
  EXPECT_EQ(followed.header.at("role"), "followed");
  EXPECT_NEAR(followed.header.at("start_s"), 2.1, 1e-9);
}

TEST_F(ViewMakerTest, FirstMapOfAnEpisodeIsFull) {
  for (int episode = 0; episode < 2; ++episode) {
    inbox_.begin(ball_world());
    tell(0.0);
    look(1000);
    const auto map = std::ranges::find(sink_.messages, ViewKind::kMap, &ViewMessage::kind);
    ASSERT_NE(map, sink_.messages.end());
    EXPECT_EQ(DecodedMessage(*map->bytes).header.at("full"), true);
    sink_.messages.clear();
  }
}

TEST_F(ViewMakerTest, SlicesComeAtOnceAndWithEachMap) {
  const SliceRequest across{2, 1.0}, along{0, 0.5};
  inbox_.begin(ball_world());
  tell(0.0);
  look();
  sink_.wanted.slices = {across};
  look(1);
  ASSERT_EQ(sink_.slices.size(), 1U) << "of the map that is there";
  look(1);
  EXPECT_EQ(sink_.slices.size(), 1U) << "it is the same still";
  sink_.wanted.slices = {across, along};
  look(1);
  ASSERT_EQ(sink_.slices.size(), 2U);
  EXPECT_EQ(sink_.slices[1].first, along);
  tell(0.5, 0.5);
  look(500);
  ASSERT_EQ(sink_.slices.size(), 4U);
  EXPECT_EQ(DecodedMessage(*sink_.slices[3].second.bytes).header.at("time_s"), 0.52);
  sink_.wanted.slices.clear();
  tell(1.0, 1.0);
  look(500);
  EXPECT_EQ(sink_.slices.size(), 4U);
}

TEST_F(ViewMakerTest, TellsOfTracksWhenTheyChange) {
  inbox_.begin(ball_world());
  inbox_.stepped(step_at(0.1));
  look();
  EXPECT_THAT(sink_.take_kinds(), Not(Contains("tracks"))) << "there are none";
  ObservedStep step = step_at(0.2);
  step.tracks = std::make_shared<const Tracks>();
  for (int i = 0; i < 2; ++i) {
    inbox_.stepped(step);
    look(200);
    const auto told = std::ranges::count(sink_.messages, ViewKind::kTracks, &ViewMessage::kind);
    EXPECT_EQ(told, i == 0 ? 1 : 0);
    sink_.messages.clear();
  }
  sink_.wanted.newcomers = true;
  look(1);
  EXPECT_EQ(std::ranges::count(sink_.greeting, ViewKind::kTracks, &ViewMessage::kind), 1);
  step.prediction = std::make_shared<const Prediction>();
  inbox_.stepped(step);
  look(200);
  EXPECT_THAT(sink_.take_kinds(), Contains("tracks"));
}

TEST_F(ViewMakerTest, TellsOfContactsBeforeTheEnd) {
  inbox_.begin(ball_world());
  look();
  (void)sink_.take_kinds();
  inbox_.end(
      {Stamp::from_seconds(5.0), false, "touched", {{"base", "walker", 2.0, 2.5, 0.01, 0.1}}});
  look(1);
  ASSERT_EQ(sink_.messages.size(), 2U);
  EXPECT_EQ(sink_.messages[0].kind, ViewKind::kEvent);
  EXPECT_EQ(sink_.messages[0].stamp, Stamp::from_seconds(2.0));
  EXPECT_EQ(sink_.messages[1].kind, ViewKind::kEnd);
}

TEST_F(ViewMakerTest, StateShowsTheNewestKnownPose) {
  inbox_.begin(ball_world());
  ObservedStep step = step_at(1.0);
  inbox_.stepped(step);
  look();
  step.stamp = Stamp::from_seconds(2.0);
  step.q.resize(0);  // not known for a while
  inbox_.stepped(step);
  look(100);
  std::erase_if(sink_.messages, [](const ViewMessage& m) { return m.kind != ViewKind::kState; });
  ASSERT_EQ(sink_.messages.size(), 2U);
  const DecodedMessage message(*sink_.messages[1].bytes);
  EXPECT_EQ(message.header.at("time_s"), 2.0);
  EXPECT_EQ(message.f32(0), 1.0F);
  ASSERT_EQ(message.payload.size(), 2U * 7U * 4U) << "the link, and the box that moves";
  EXPECT_NEAR(message.f32(8), 2.0F, 1e-6F);  // along y
  EXPECT_EQ(message.header.at("clearance").at("object"), "floor");
}

}  // namespace
}  // namespace sidestep
