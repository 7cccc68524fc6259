#include "run_recorder.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/low_priority.hpp>

namespace sidestep {
namespace {

using std::chrono::steady_clock;

/// What is not on its way to the disk after so long is written however little it is.
constexpr std::chrono::milliseconds kLongestHeld{1000};

/// 19 would starve the thread, and lose depth images, on a machine that is busy.
constexpr int kNice = 10;

std::size_t bytes_of(const Trajectory& trajectory) noexcept {
  return sizeof(double) *
         (trajectory.times_s.size() + trajectory.positions.size() + trajectory.velocities.size());
}

std::size_t bytes_of(const Frame& frame) noexcept {
  if (const auto* const depth = std::get_if<DepthImage>(&frame.measurement)) {
    return sizeof frame + depth->depth_m.size() * sizeof(float);
  }
  return sizeof frame + std::get<PointCloud>(frame.measurement).points_m.size() * 3 * sizeof(float);
}

/// What a map keeps from being freed: its own blocks, and its table.
std::size_t bytes_of(const ObservedMap& map) noexcept {
  const std::size_t changed = map.step.update.changed_blocks.size();
  const std::size_t blocks =
      map.snapshot.field == nullptr
          ? 0
          : static_cast<std::size_t>(block_counts(map.snapshot.field->info().grid).prod());
  return changed * (sizeof(FieldBlock) + sizeof(KnownBlock)) + blocks * 2 * sizeof(void*);
}

std::size_t bytes_of(const ObservedEvent& event) noexcept {
  std::size_t bytes = sizeof event + event.event.cause.size();
  if (event.followed) bytes += bytes_of(*event.followed);
  if (event.event.refused) bytes += bytes_of(*event.event.refused);
  return bytes;
}

}  // namespace

void ViewRecorder::begin(const ObservedWorld& world) {
  constexpr std::chrono::seconds kBetweenEpisodes{1};
  begin_ = last_ = last_ + kBetweenEpisodes;
  inbox_.begin(world);  // Its clock is not known before anything has a stamp.
}

void ViewRecorder::mapped(const ObservedMap& map) {
  inbox_.mapped(map);
  make(map.published);
}

void ViewRecorder::stepped(const ObservedStep& step) {
  inbox_.stepped(step);
  make(step.stamp);
}

void ViewRecorder::happened(const ObservedEvent& event) {
  inbox_.happened(event);
  make(event.event.stamp);
}

void ViewRecorder::end(const ObservedEnd& end) {
  inbox_.end(end);
  make(end.stamp);
}

void ViewRecorder::make(Stamp stamp) {
  made_ = stamp;
  last_ = std::max(last_, begin_ + std::chrono::nanoseconds(stamp.ns));
  if (maker_.is_wanted()) maker_.make(last_, inbox_.take());
}

Result<std::unique_ptr<RunRecorder>> RunRecorder::start(const std::filesystem::path& file, Log& log,
                                                        std::size_t most_queued_bytes) {
  auto bag = SIDESTEP_TRY(RunBag::create(file));
  return std::unique_ptr<RunRecorder>(
      new RunRecorder(std::move(bag), file, log, most_queued_bytes));
}

RunRecorder::RunRecorder(RunBag bag, std::filesystem::path file, Log& log,
                         std::size_t most_queued_bytes)
    : queue_(most_queued_bytes),
      file_(std::move(file)),
      log_(log),
      bag_(std::move(bag)),
      view_([this](Stamp stamp, const std::string& message) { bag_.viewed(stamp, message); }),
      thread_([this] { work(); }) {}

RunRecorder::~RunRecorder() {
  try {
    finish();
  } catch (const std::exception& exception) {
    tell_loss(exception);
  }
}

void RunRecorder::begin(const ObservedWorld& world) {
  queue_.push(RecordClass::kEvent, world, sizeof world);
}

void RunRecorder::mapped(const ObservedMap& map) {
  if (map.frame != nullptr) {
    queue_.push(RecordClass::kDepth, Seen{map.frame, map.received}, bytes_of(*map.frame));
  }
  Mapped mapped{map};
  mapped.map.frame = nullptr;
  queue_.push(RecordClass::kMap, std::move(mapped), bytes_of(map));
}

void RunRecorder::stepped(const ObservedStep& step) {
  queue_.push(
      RecordClass::kState, step,
      sizeof step + static_cast<std::size_t>(step.q.size() + step.q_true.size()) * sizeof(double));
}

void RunRecorder::happened(const ObservedEvent& event) {
  queue_.push(RecordClass::kEvent, event, bytes_of(event));
}

void RunRecorder::end(const ObservedEnd& end) {
  queue_.push(RecordClass::kEvent, end, sizeof end + end.verdict.size());
}

void RunRecorder::work() {
  lower_thread_priority(kNice);
  auto flushed = steady_clock::now();
  while (!queue_.is_done()) {
    // A robot that throws costs what it was asked for.
    try {
      const auto item = queue_.pop(kLongestHeld);
      if (item && !bag_.fault()) write(*item);
      if (steady_clock::now() - flushed >= kLongestHeld) {
        bag_.flush();
        flushed = steady_clock::now();
      }
      tell_fault();
    } catch (const std::exception& exception) {
      tell_loss(exception);
    }
  }
}

void RunRecorder::tell_loss(const std::exception& exception) noexcept {
  try {
    log_.warn(file_.string() + ": not recorded: " + exception.what());
  } catch (const std::exception&) {  // There is no memory even to say so.
  }
}

void RunRecorder::write(const Item& item) {
  struct Writing {
    RunRecorder& to;
    void operator()(const ObservedWorld& world) const {
      to.newest_frame_ = nullptr;
      to.bag_.begin(world);
      to.view_.begin(world);
    }
    void operator()(const Seen& seen) const {
      to.newest_frame_ = seen.frame;
      to.bag_.seen(*seen.frame, seen.received);
    }
    void operator()(const Mapped& mapped) const { to.write_map(mapped.map); }
    void operator()(const ObservedStep& step) const {
      to.bag_.stepped(step);
      to.view_.stepped(step);
    }
    void operator()(const ObservedEvent& event) const {
      to.bag_.happened(event);
      to.view_.happened(event);
    }
    void operator()(const ObservedEnd& end) const {
      to.view_.end(end);  // First: then the bag's clock is the next episode's.
      to.bag_.end(end);
    }
  };
  std::visit(Writing{*this}, item);
}

void RunRecorder::write_map(ObservedMap map) {
  bag_.mapped(map.snapshot, map.published);
  map.frame = newest_frame_;
  view_.mapped(map);
}

void RunRecorder::tell_fault() {
  if (has_told_fault_ || !bag_.fault()) return;
  has_told_fault_ = true;
  log_.error(bag_.fault()->describe() + "; the run goes on, and is recorded no further");
}

void RunRecorder::finish() {
  if (!thread_.joinable()) return;
  queue_.close();
  thread_.join();
  const Dropped dropped = queue_.dropped();
  bag_.close(dropped);
  tell_fault();
  if (!bag_.fault()) {
    log_.info("recorded " + std::to_string(bag_.message_count()) + " messages, " +
              format("%.1f MB", static_cast<double>(bag_.bytes()) * 1e-6) + ", in " +
              file_.string());
  }
  if (dropped == Dropped{}) return;
  log_.warn("the recording could not keep up: it lacks " +
            std::to_string(dropped.of(RecordClass::kDepth)) + " depth images, " +
            std::to_string(dropped.of(RecordClass::kMap)) + " maps, " +
            std::to_string(dropped.of(RecordClass::kState)) + " states");
}

}  // namespace sidestep
