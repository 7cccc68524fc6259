#include "view_feed.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "view_testing.hpp"

namespace sidestep {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using testing_support::ball_world;
using testing_support::map_at;
using testing_support::plan_at;
using testing_support::step_at;

TEST(ViewInbox, KeepsTheNewestAndEveryTime) {
  ViewInbox inbox;
  inbox.begin(ball_world());
  const auto field = testing_support::ball_field({0, 1, 1});
  inbox.mapped(map_at(0.1, 1, testing_support::ball_field({1, 1, 1})));
  inbox.mapped(map_at(0.2, 4, field));  // two frames were passed over
  inbox.stepped(step_at(0.1));
  inbox.stepped(step_at(0.2));
  const auto news = inbox.take();
  ASSERT_EQ(news.size(), 1U);
  ASSERT_TRUE(news[0].world && news[0].map && news[0].step);
  EXPECT_EQ(news[0].map->field, field);
  EXPECT_EQ(news[0].step->stamp, Stamp::from_seconds(0.2));
  EXPECT_EQ(news[0].frames.size(), 2U);
  EXPECT_THAT(news[0].frames[1],
              ElementsAre(DoubleEq(0.2), DoubleEq(0.21), DoubleEq(0.22), 2.0, 3.0));
  EXPECT_EQ(news[0].frames_dropped, 2);
  EXPECT_EQ(news[0].checks, 7);
  EXPECT_TRUE(inbox.take().empty());
}

TEST(ViewInbox, TellsTheLongestStepOfEachTenthOfASecond) {
  ViewInbox inbox;
  inbox.begin(ball_world());
  inbox.stepped(step_at(1.01, 0.5));
  inbox.stepped(step_at(1.05, 2.0));
  inbox.stepped(step_at(1.09, 1.0));
  inbox.stepped(step_at(1.15, 0.25));
  auto news = inbox.take();
  EXPECT_THAT(news.at(0).steps, ElementsAre(ElementsAre(DoubleEq(1.05), 2.0)));
  inbox.stepped(step_at(1.19, 0.75));
  inbox.end({});
  news = inbox.take();
  EXPECT_THAT(news.at(0).steps, ElementsAre(ElementsAre(DoubleEq(1.19), 0.75)));
}

TEST(ViewInbox, IsBounded) {
  ViewInbox inbox;
  inbox.begin(ball_world());
  const ObservedEvent plan = plan_at(0.0);
  inbox.happened(plan);
  ObservedEvent failed;
  failed.event.kind = ReplannerEvent::Kind::kReplanFailed;
  const auto field = testing_support::ball_field({0, 1, 1});
  for (int i = 0; i < 1000; ++i) {
    inbox.happened(failed);
    inbox.mapped(map_at(i, i, field));
    inbox.stepped(step_at(i));
  }
  const auto news = inbox.take();
  EXPECT_EQ(news.at(0).events.size(), EpisodeNews::kMostEvents);
  EXPECT_EQ(news[0].frames.size(), EpisodeNews::kMostTimes);
  EXPECT_EQ(news[0].steps.size(), EpisodeNews::kMostTimes);
  EXPECT_DOUBLE_EQ(news[0].frames.back()[0], 999.0);
  ASSERT_TRUE(news[0].plan) << "what is followed is not forgotten";
  EXPECT_EQ(news[0].plan->followed, plan.followed);
  for (int i = 0; i < 10; ++i) {
    ObservedWorld world = ball_world();
    world.episode = i;
    inbox.begin(world);
  }
  const auto episodes = inbox.take();
  ASSERT_EQ(episodes.size(), ViewInbox::kMostEpisodes);
  EXPECT_EQ(episodes.back().world->episode, 9);
}

TEST(ViewInbox, CountsAnewInEachEpisode) {
  ViewInbox inbox;
  inbox.begin(ball_world());
  inbox.mapped(map_at(0.1, 0, nullptr));
  inbox.mapped(map_at(0.2, 5, nullptr));
  inbox.begin(ball_world());
  inbox.mapped(map_at(0.1, 9, nullptr));
  const auto news = inbox.take();
  ASSERT_EQ(news.size(), 2U);
  EXPECT_EQ(news[0].frames_dropped, 4);
  EXPECT_EQ(news[1].frames_dropped, 0);
}

}  // namespace
}  // namespace sidestep
