#include <algorithm>

#include <sidestep/core/format.hpp>
#include <sidestep/measures/true_map.hpp>
#include "closed_loop.hpp"

namespace sidestep {
namespace {

/// By the wall's clock: how long to wait for a frame before looking whether to stop.
constexpr double kPatience_s = 0.1;

std::vector<Sensor> sensors_of(const ReplanWorld& world) {
  std::vector<Sensor> sensors = {{*world.source, plugin_of(world.source)}};
  for (const FurtherSource& further : world.further) {
    sensors.push_back({*further.source, further.name, further.is_needed});
  }
  return sensors;
}

}  // namespace

EpisodeProgress::EpisodeProgress(Tell tell, Stamp begin, double duration_s, Wall::time_point wall)
    : tell_(std::move(tell)),
      begin_(begin),
      limit_(format(" s of at most %g s", duration_s)),
      told_(wall) {}

void EpisodeProgress::note(Stamp now, Wall::time_point wall) {
  if (!tell_ || wall - told_ < std::chrono::seconds(5)) return;
  told_ = wall;
  tell_(format("%.0f", now.seconds() - begin_.seconds()) + limit_);
}

EpisodeMapping::EpisodeMapping(ReplanWorld& world, const ReplanConfiguration& configuration,
                               Log& log, RunObserver* observer)
    : clock_(*world.clock),
      is_lockstep_(configuration.experiment.is_lockstep()),
      truth_source_(configuration.experiment.sees_truth() ? world.truth : nullptr),
      latency_(configuration.experiment.latency),
      observer_(observer),
      slot_(*world.slot),
      sensors_(sensors_of(world), *world.clock, !is_lockstep_,
               configuration.planning.floor ? std::optional(configuration.planning.floor->height_m)
                                            : std::nullopt,
               world.robot, log),
      tracker_({}, world.robot),
      base_(world.base),
      is_tracking_(configuration.experiment.tracks || world.predictor ||
                   (world.gaze && world.gaze->wants_tracks())),
      // What nobody predicts stays in the map.
      masks_tracks_(world.predictor && world.predictor->subject() != PredictionSubject::kNothing),
      source_name_(world.further.empty() ? plugin_of(world.source) : "the sensors"),
      pipeline_({sensors_,
                 *world.mapper,
                 *world.field_builder,
                 is_lockstep_ ? made_ : slot_,
                 log,
                 {source_name_, plugin_of(world.mapper), plugin_of(world.field_builder),
                  world.localiser ? plugin_of(world.localiser) : ""},
                 &motion_detector_,
                 true,
                 is_tracking_ ? &tracker_ : nullptr,
                 masks_tracks_,
                 world.localiser.get(),
                 world.base}),
      occupancy_(dynamic_cast<const OccupancyView*>(world.mapper.get())) {
  const bool measures =
      is_lockstep_ && configuration.experiment.truth.measure && world.scene && occupancy_;
  if (measures) {
    const TruthSettings& settings = configuration.experiment.truth;
    truth_.emplace(*world.scene, occupancy_->occupancy_grid(), settings);
    swept_.emplace(world.robot, occupancy_->occupancy_grid(), settings.min_z_m);
    if (is_tracking_) track_truth_.emplace(*world.scene);
  }
  sensors_.keep_last(measures || observer_ != nullptr);
  auto* const display = dynamic_cast<MapDisplay*>(world.executor.get());
  if (is_lockstep_ || display == nullptr) return;
  show_ = std::make_unique<MapShow>(*display, slot_, plugin_of(world.executor), log);
}

bool EpisodeMapping::map_one(const Deadline& deadline) {
  const auto step = catch_all("mapping", [&] {
    auto made = pipeline_.step(deadline);
    note_trouble(made);
    if (made && *made) note_frame(std::move(**made));
    return made;
  });
  if (!step) {
    // A goal's end cancels a wait; for the next goal the same sensors are asked again.
    has_ended_ = step.error().code != ErrorCode::kDeadlineExceeded &&
                 step.error().code != ErrorCode::kCancelled;
    if (has_ended_) fault_ = step.error();
    return false;
  }
  if (!*step) {
    has_ended_ = true;
    return false;
  }
  return true;
}

std::shared_ptr<const Frame> EpisodeMapping::mapped_frame(const MappingStep& step) const {
  if (!step.localisation || sensors_.last() == nullptr) return sensors_.last();
  Frame frame = *sensors_.last();
  move_frame(frame, step.localisation->T_map_odom, base_);
  return std::make_shared<const Frame>(std::move(frame));
}

/// In lockstep its field is there once the latency has passed.
void EpisodeMapping::note_frame(MappingStep step) {
  const double delay_s = is_lockstep_ ? latency_.sensor_s : 0.0;
  Stamp published = clock_.now();
  if (is_lockstep_) published.ns += Stamp::from_seconds(delay_s + latency_.mapping_s).ns;
  frames_.push_back({step.stamp.seconds(), sensors_.received().seconds() + delay_s,
                     published.seconds(), step.integrate_ms, step.field_ms});
  const std::shared_ptr<const Frame> frame = mapped_frame(step);
  if (truth_ && frame) {
    truth_->observe(*frame, *occupancy_);
    if (frame->joint_positions) {
      swept_->enter(as_span(*frame->joint_positions), occupancy_->known());
    }
    if (track_truth_) track_truth_->observe(*made_.snapshot().tracks, truth_->in_view());
  }
  if (observer_ == nullptr || !shows_) return;
  const MapSnapshot snapshot = (is_lockstep_ ? made_ : slot_).snapshot();
  observer_->mapped({frame, std::move(step), snapshot, sensors_.received(), published});
}

void EpisodeMapping::note_trouble(const Result<std::optional<MappingStep>>& step) {
  // A fault may last for hours: only what came of it in this step is looked at.
  const std::vector<Error> skipped = pipeline_.take_bad_frames();
  const std::lock_guard lock(trouble_mutex_);
  if (step && *step) {
    const Stamp newest = newest_.value_or((*step)->stamp);
    newest_ = std::max(newest, (*step)->stamp);
    trouble_.clear();
    if ((*step)->stamp < newest) {
      trouble_ = source_name_ + ": frame " + std::to_string((*step)->frame_sequence) + " is of " +
                 std::to_string((*step)->stamp.seconds()) + " s, one of " +
                 std::to_string(newest.seconds()) + " s came before it";
    }
  } else if (step) {
    trouble_ = source_name_ + " has no more frames";
  } else if (step.error().code == ErrorCode::kDeadlineExceeded) {
    if (!skipped.empty()) trouble_ = "unusable: " + skipped.back().describe();
  } else if (step.error().code != ErrorCode::kCancelled) {
    trouble_ = step.error().describe();
  }
}

std::string EpisodeMapping::trouble() const {
  const std::lock_guard lock(trouble_mutex_);
  if (!trouble_.empty()) return trouble_;
  if (!newest_) return source_name_ + " has given no frame yet";
  return source_name_ + " has given no frame since that of " + std::to_string(newest_->seconds()) +
         " s";
}

std::shared_ptr<const DistanceField> EpisodeMapping::map_first(const Deadline& deadline) {
  if (is_lockstep_) {
    advance(clock_.now());
    return made_.pin();
  }
  if (!thread_.joinable()) map_one(deadline);
  constexpr auto kLook = std::chrono::milliseconds(20);
  while (thread_.joinable() && slot_.pin() == nullptr && !deadline.expired()) {
    slot_.wait_for_newer(nullptr, std::chrono::steady_clock::now() + kLook);
  }
  return slot_.pin();
}

void EpisodeMapping::give_truth() {
  // Wider than any scene, in which all is known.
  const Eigen::AlignedBox3d everywhere(Eigen::Vector3d::Constant(-100.0),
                                       Eigen::Vector3d::Constant(100.0));
  const Stamp now = clock_.now();
  TrueMap map = true_map(*truth_source_->scene_until(now), now, everywhere, masks_tracks_);
  made_.publish(MapSnapshot{std::move(map.field), nullptr, std::move(map.tracks)});
  const double received_s = now.seconds() + latency_.sensor_s;
  frames_.push_back({now.seconds(), received_s, received_s + latency_.mapping_s, 0.0, 0.0});
}

void EpisodeMapping::advance(Stamp now) {
  const auto after = [](Stamp stamp, double delay_s) {
    return Stamp{stamp.ns + Stamp::from_seconds(delay_s).ns};
  };
  bool has_mapped = false;
  if (now >= busy_until_ && truth_source_ != nullptr) {
    give_truth();
    has_mapped = true;
  } else if (now >= busy_until_ && !has_ended_) {
    has_mapped = map_one(Deadline());
  }
  if (has_mapped) {
    busy_until_ = after(now, latency_.mapping_s);
    waiting_.push_back({after(busy_until_, latency_.sensor_s), made_.snapshot()});
  }
  while (!waiting_.empty() && waiting_.front().due <= now) {
    slot_.publish(std::move(waiting_.front().snapshot));
    waiting_.pop_front();
  }
}

void EpisodeMapping::start() {
  if (thread_.joinable()) return;
  thread_ = std::jthread([this](const std::stop_token& stop) {
    while (!stop.stop_requested() && !has_ended_) {
      map_one(Deadline::after_s(kPatience_s, stop));
    }
  });
}

void EpisodeMapping::stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

MappingRecord EpisodeMapping::take_record() {
  MappingRecord record;
  record.mapping = std::exchange(frames_, {});
  record.views = sensors_.take_views();
  record.dropped = truth_source_ != nullptr ? 0 : sensors_.take_span() - std::ssize(record.mapping);
  return record;
}

std::optional<MapFollowing> EpisodeMapping::following() const {
  if (!truth_) return std::nullopt;
  const TruthRecord record = truth_->finish(*occupancy_);
  MapFollowing following{record.appear_frames,  record.gone_frames, record.ghost_vox,
                         swept_->entered_vox(), swept_->seen_vox(), {}};
  if (track_truth_) following.tracks = track_truth_->finish();
  return following;
}

}  // namespace sidestep
