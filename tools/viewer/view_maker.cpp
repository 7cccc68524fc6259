#include "view_maker.hpp"

#include <algorithm>
#include <ctime>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

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

ViewMaker::ViewMaker(std::vector<ViewSink*> sinks, const ViewRates& rates)
    : sinks_(std::move(sinks)),
      demands_(sinks_.size()),
      state_rate_{period_of(rates.state_hz)},
      map_rate_{period_of(rates.map_hz)},
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
  Scratch scratch;
  std::vector<Transform> T_world_link(world_->robot->description().links.size());
  world_->robot->link_poses(q_, T_world_link, scratch);
  const double time_s = step_->stamp.seconds();
  std::vector<Transform> T_world_object;
  if (world_->scene != nullptr) {
    for (const SceneObject& object : world_->scene->objects()) {
      if (object.moves()) T_world_object.push_back(object.T_world_object(time_s));
    }
  }
  const DistanceField* const field = map_ ? map_->field.get() : nullptr;
  publish(kState,
          state_message(*step_, T_world_link, T_world_object, clearance_->find(q_, time_s, field)));
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
    sink->publish_slice(request, slice_message(map_->published, map_->field->info().stamp,
                                               make_slice(*map_->field, request)));
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
  for (const Slot slot : {kState, kFrame, kFollowed, kRefused, kEvent, kTiming, kEnd}) add(slot);
  for (ViewSink* const sink : sinks_) sink->greet(greeting);
}

void ViewMaker::publish(Slot slot, ViewMessage message) {
  for (ViewSink* const sink : sinks_) sink->publish(message);
  newest_[slot] = std::move(message);
}

}  // namespace sidestep
