#include "observers.hpp"

#include <utility>

namespace sidestep {

void RunObservers::begin(const ObservedWorld& world) {
  for (RunObserver* const observer : observers_) observer->begin(world);
}

void RunObservers::mapped(const ObservedMap& map) {
  for (RunObserver* const observer : observers_) observer->mapped(map);
}

void RunObservers::stepped(const ObservedStep& step) {
  for (RunObserver* const observer : observers_) observer->stepped(step);
}

void RunObservers::happened(const ObservedEvent& event) {
  for (RunObserver* const observer : observers_) observer->happened(event);
}

void RunObservers::end(const ObservedEnd& end) {
  for (RunObserver* const observer : observers_) observer->end(end);
}

Result<std::unique_ptr<AttachedObservers>> attach_observers(const RunOptions& options,
                                                            LiveView* live, Log& log) {
  auto attached = std::make_unique<AttachedObservers>();
  if (options.record) {
    auto recorder = RunRecorder::start(*options.record, log);
    if (!recorder) {
      Error error = std::move(recorder.error());
      if (error.code == ErrorCode::kInvalidArgument) error.code = ErrorCode::kConfig;
      error.where = "--record " + error.where;
      return tl::make_unexpected(std::move(error));
    }
    attached->recorder_ = std::move(*recorder);
    attached->all_.add(*attached->recorder_);
  }
  if (live != nullptr) {
    attached->feed_ = std::make_unique<ViewFeed>(std::vector<ViewSink*>{&live->sink()}, log);
    attached->all_.add(*attached->feed_);
  }
  return attached;
}

}  // namespace sidestep
