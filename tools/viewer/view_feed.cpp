#include "view_feed.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <exception>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/low_priority.hpp>

namespace sidestep {
namespace {

template <class Value>
void push_bounded(std::deque<Value>& queue, const Value& value) {
  if (queue.size() == EpisodeNews::kMostTimes) queue.pop_front();
  queue.push_back(value);
}

std::chrono::nanoseconds period_of(double rate_hz) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(1.0 / rate_hz));
}

/// That this thread has worked.
std::chrono::nanoseconds thread_time() noexcept {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace

EpisodeNews& ViewInbox::current() {
  if (news_.empty()) news_.emplace_back();
  return news_.back();
}

void ViewInbox::add_counts() {
  if (news_.empty()) return;
  news_.back().checks = counters_.checks;
  news_.back().frames_dropped = counters_.frames_dropped;
}

void ViewInbox::begin(const ObservedWorld& world) {
  EpisodeNews fresh;
  fresh.world = world;
  EpisodeNews oldest;  // freed outside the lock
  const std::lock_guard lock(mutex_);
  add_counts();
  if (news_.size() == kMostEpisodes) {
    oldest = std::move(news_.front());
    news_.erase(news_.begin());
  }
  news_.push_back(std::move(fresh));
  counters_ = {};
}

void ViewInbox::mapped(const ObservedMap& map) {
  std::optional<NewestMap> newest(NewestMap{map.frame, map.snapshot.field, map.published});
  const std::int64_t number = map.step.frame_sequence;
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  std::swap(news.map, newest);  // what was there is freed after the lock: declared before it
  push_bounded(news.frames, {map.step.stamp.seconds(), map.received.seconds(),
                             map.published.seconds(), map.step.integrate_ms, map.step.field_ms});
  if (counters_.last_frame) {
    counters_.frames_dropped += std::max<std::int64_t>(0, number - *counters_.last_frame - 1);
  }
  counters_.last_frame = number;
}

void ViewInbox::stepped(const ObservedStep& step) {
  const auto tenth = static_cast<std::int64_t>(std::floor(10.0 * step.stamp.seconds()));
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  news.step = step;
  counters_.checks = step.checks;
  if (tenth != counters_.tenth) {
    if (counters_.tenth >= 0) push_bounded(news.steps, counters_.longest);
    counters_.tenth = tenth;
    counters_.longest = {step.stamp.seconds(), step.step_ms};
  } else if (step.step_ms > counters_.longest[1]) {
    counters_.longest = {step.stamp.seconds(), step.step_ms};
  }
}

void ViewInbox::happened(const ObservedEvent& event) {
  ObservedEvent copy = event;
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  if (news.events.size() == EpisodeNews::kMostEvents) {
    if (news.events.front().followed != nullptr) news.plan = std::move(news.events.front());
    news.events.pop_front();
  }
  news.events.push_back(std::move(copy));
}

void ViewInbox::end(const ObservedEnd& end) {
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  news.end = end;
  if (counters_.tenth >= 0) push_bounded(news.steps, counters_.longest);
  counters_.tenth = -1;
}

std::vector<EpisodeNews> ViewInbox::take() {
  std::vector<EpisodeNews> taken;
  const std::lock_guard lock(mutex_);
  add_counts();
  std::swap(taken, news_);
  return taken;
}

ViewMaker::ViewMaker(std::vector<ViewSink*> sinks, const ViewRates& rates)
    : sinks_(std::move(sinks)),
      demands_(sinks_.size()),
      state_rate_{period_of(rates.state_hz)},
      map_rate_{period_of(rates.map_hz)},
      tracks_rate_{period_of(rates.map_hz)},
      frame_rate_{period_of(rates.frame_hz)},
      timing_rate_{period_of(rates.timing_hz)} {}

bool ViewMaker::is_wanted() {
  for (std::size_t i = 0; i < sinks_.size(); ++i) demands_[i] = sinks_[i]->demand();
  return std::ranges::any_of(demands_, &ViewSink::Demand::any);
}

void ViewMaker::make(TimePoint now, std::vector<EpisodeNews> news) {
  const bool newcomers = std::ranges::any_of(demands_, &ViewSink::Demand::newcomers);
  for (EpisodeNews& one : news) {
    if (one.world) begin_episode(*one.world);
    take_over(one);
    tell_events(one);
    if (!one.end) continue;
    make_due(now, true);
    for (const TrueContact& contact : one.end->contacts) publish(kEvent, contact_message(contact));
    publish(kEnd, end_message(*one.end));
  }
  make_due(now, newcomers);
  if (newcomers) greet();
}

void ViewMaker::begin_episode(const ObservedWorld& world) {
  world_ = world;
  clearance_ = std::make_unique<RobotClearance>(world.robot, world.scene, as_span(world.q_start));
  q_.assign(world.q_start.begin(), world.q_start.end());
  bits_.clear();
  map_.reset();
  step_.reset();
  tracks_.reset();
  prediction_.reset();
  timing_ = {};
  has_new_map_ = has_new_frame_ = has_new_step_ = has_new_times_ = false;
  newest_.fill(std::nullopt);
  slices_.clear();
  publish(kWorld, world_message(world));
}

void ViewMaker::take_over(EpisodeNews& news) {
  if (news.map) {
    map_ = std::move(news.map);
    has_new_map_ = map_->field != nullptr;
    has_new_frame_ = map_->frame != nullptr;
  }
  if (news.step) {
    step_ = std::move(news.step);
    has_new_step_ = true;
    const Eigen::VectorXd& q = step_->q.size() > 0 ? step_->q : step_->q_true;
    if (q.size() > 0) q_.assign(q.begin(), q.end());
  }
  has_new_times_ = has_new_times_ || !news.frames.empty() || !news.steps.empty();
  timing_.frames.insert(timing_.frames.end(), news.frames.begin(), news.frames.end());
  timing_.steps.insert(timing_.steps.end(), news.steps.begin(), news.steps.end());
  timing_.checks = news.checks;
  timing_.frames_dropped = news.frames_dropped;
}

void ViewMaker::tell_events(EpisodeNews& news) {
  if (!world_) return;
  if (news.plan) {
    const ObservedEvent& plan = *news.plan;
    tell_plan(kFollowed, plan.event.stamp, plan.followed.get(), plan.followed_start);
  }
  for (const ObservedEvent& event : news.events) {
    publish(kEvent, event_message(event));
    const Stamp stamp = event.event.stamp;
    tell_plan(kRefused, stamp, event.event.refused.get(), stamp);
    tell_plan(kFollowed, stamp, event.followed.get(), event.followed_start);
  }
}

void ViewMaker::tell_plan(Slot role, Stamp time, const Trajectory* trajectory, Stamp start) {
  if (trajectory == nullptr) return;
  publish(role, plan_message(time, role == kRefused ? "refused" : "followed", *trajectory, start,
                             *world_->robot));
}

void ViewMaker::make_due(TimePoint now, bool force) {
  if (!world_) return;
  if (has_new_step_ && state_rate_.due(now, force)) make_state();
  const bool are_new = step_ && (step_->tracks != tracks_ || step_->prediction != prediction_);
  if (are_new && tracks_rate_.due(now, force)) make_tracks();
  bool is_new_map = false;
  if (has_new_map_ && map_rate_.due(now, force)) {
    make_map(now);
    is_new_map = true;
  }
  make_slices(is_new_map);
  if (has_new_frame_ && frame_rate_.due(now, force)) make_frame();
  if (has_new_times_ && timing_rate_.due(now, force)) make_timing();
}

void ViewMaker::make_state() {
  has_new_step_ = false;
  const double time_s = step_->stamp.seconds();
  std::vector<Transform> T_world_object;
  if (world_->scene != nullptr) {
    for (const SceneObject& object : world_->scene->objects()) {
      if (object.moves()) T_world_object.push_back(object.T_world_object(time_s));
    }
  }
  const DistanceField* const field = map_ ? map_->field.get() : nullptr;
  publish(kState, state_message(*step_, link_poses(*world_->robot, q_), T_world_object,
                                clearance_->find(q_, time_s, field)));
}

void ViewMaker::make_tracks() {
  tracks_ = step_->tracks;
  prediction_ = step_->prediction;
  publish(kTracks, tracks_message(step_->stamp, tracks_.get(), prediction_.get()));
}

void ViewMaker::make_map(TimePoint now) {
  has_new_map_ = false;
  const auto begin = thread_time();
  bits_stamp_ = map_->field->info().stamp;
  bits_time_ = map_->published;
  const OccupancyBits::Change change = bits_.update(map_->field);
  if (bits_.is_empty()) return;
  const ViewMessage message =
      map_message(bits_time_, bits_stamp_, bits_, change.blocks, change.is_new_grid);
  for (ViewSink* const sink : sinks_) sink->publish(message);
  // Fields that have to be sampled take long: no more than a tenth of the time.
  map_rate_.next = std::max(map_rate_.next, now + 10 * (thread_time() - begin));
}

void ViewMaker::make_frame() {
  has_new_frame_ = false;
  if (auto message = frame_message(map_->published, *map_->frame)) {
    publish(kFrame, std::move(*message));
  }
}

void ViewMaker::make_timing() {
  has_new_times_ = false;
  Stamp time = step_ ? step_->stamp : Stamp{};
  if (map_) time = std::max(time, map_->published);
  publish(kTiming, timing_message(time, timing_));
  timing_.frames.clear();
  timing_.steps.clear();
}

void ViewMaker::make_slices(bool is_new_map) {
  if (!map_ || map_->field == nullptr || map_->field->info().grid.voxel_count() == 0) return;
  std::vector<std::pair<ViewSink*, SliceRequest>> wanted;
  for (std::size_t i = 0; i < sinks_.size(); ++i) {
    for (const SliceRequest& request : demands_[i].slices) wanted.emplace_back(sinks_[i], request);
  }
  for (const auto& [sink, request] : wanted) {
    if (!is_new_map && std::ranges::count(slices_, std::pair(sink, request)) > 0) continue;
    const FieldSlice slice =
        make_slice(*map_->field, request, step_ ? step_->prediction.get() : nullptr,
                   step_ ? step_->stamp : Stamp{});
    sink->publish_slice(request, slice_message(map_->published, map_->field->info().stamp, slice));
  }
  slices_ = std::move(wanted);
}

void ViewMaker::greet() {
  std::vector<ViewMessage> greeting;
  const auto add = [&](Slot slot) {
    if (newest_[slot]) greeting.push_back(*newest_[slot]);
  };
  add(kWorld);
  if (!bits_.is_empty()) {
    greeting.push_back(map_message(bits_time_, bits_stamp_, bits_, bits_.filled(), true));
  }
  for (const Slot slot : {kState, kTracks, kFrame, kFollowed, kRefused, kEvent, kTiming, kEnd})
    add(slot);
  for (ViewSink* const sink : sinks_) sink->greet(greeting);
}

void ViewMaker::publish(Slot slot, ViewMessage message) {
  for (ViewSink* const sink : sinks_) sink->publish(message);
  newest_[slot] = std::move(message);
}

ViewFeed::ViewFeed(std::vector<ViewSink*> sinks, Log& log, const ViewRates& rates)
    : maker_(std::move(sinks), rates),
      log_(log),
      period_(period_of(rates.state_hz)),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

ViewFeed::~ViewFeed() { finish(); }

void ViewFeed::finish() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

bool ViewFeed::make_once() {
  try {
    if (maker_.is_wanted()) maker_.make(std::chrono::steady_clock::now(), take());
    return true;
  } catch (const std::exception& exception) {
    log_.warn(std::string("the viewer shows no more: ") + exception.what());
    return false;
  }
}

void ViewFeed::work(const std::stop_token& stop) {
  lower_thread_priority();
  auto next = std::chrono::steady_clock::now();
  std::unique_lock lock(mutex_);
  while (true) {
    const bool is_last = stop.stop_requested();  // What was told before is still made.
    if (!make_once() || is_last) return;
    next = std::max(next + period_, std::chrono::steady_clock::now());
    wake_.wait_until(lock, stop, next, [] { return false; });
  }
}

}  // namespace sidestep
