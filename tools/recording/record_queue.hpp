#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace sidestep {

/// What is given up first where a recording cannot keep up, and what never.
enum class RecordClass : std::uint8_t { kDepth, kMap, kState, kEvent };

/// How many items of each class were given up.
struct Dropped {
  std::array<std::int64_t, 3> count{};

  [[nodiscard]] std::int64_t of(RecordClass what) const noexcept {
    return count[static_cast<std::size_t>(what)];
  }
  friend bool operator==(const Dropped&, const Dropped&) = default;
};

/// Items in the order in which they came, bounded by their bytes: where these are too many, the
/// oldest depth image is given up, where there is none the oldest map, then the oldest state, and
/// never an event. push() never waits for pop(). [any]
template <class Item>
class RecordQueue {
 public:
  explicit RecordQueue(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  void push(RecordClass what, Item item, std::size_t bytes) {
    std::deque<Entry> given_up;  // Freed outside the lock.
    {
      const std::lock_guard lock(mutex_);
      if (is_closed_) return;
      queue(what).push_back({next_++, bytes, std::move(item)});
      bytes_ += bytes;
      if (what == RecordClass::kEvent) event_bytes_ += bytes;
      for (std::size_t i = 0; i < dropped_.count.size() && bytes_ > most_bytes_; ++i) {
        while (bytes_ > most_bytes_ && !queues_[i].empty()) {
          given_up.push_back(take(queues_[i]));
          ++dropped_.count[i];
        }
      }
    }
    filled_.notify_one();
  }

  /// Whether as much may be pushed as an event, which is not given up later: events are to leave
  /// room for other things.
  [[nodiscard]] bool has_room(std::size_t bytes) const {
    const std::lock_guard lock(mutex_);
    return !is_closed_ && event_bytes_ + bytes <= most_bytes_ / 2;
  }

  /// The oldest item; waits for one, at most so long, and no longer once the queue is closed.
  [[nodiscard]] std::optional<Item> pop(std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    filled_.wait_for(lock, patience, [&] { return is_closed_ || oldest() != nullptr; });
    std::deque<Entry>* const found = oldest();
    if (found == nullptr) return std::nullopt;
    return std::move(take(*found).item);
  }

  /// What is in the queue may still be taken; nothing more is.
  void close() {
    {
      const std::lock_guard lock(mutex_);
      is_closed_ = true;
    }
    filled_.notify_all();
  }
  /// Whether it is closed and empty.
  [[nodiscard]] bool is_done() const {
    const std::lock_guard lock(mutex_);
    return is_closed_ && oldest() == nullptr;
  }

  [[nodiscard]] Dropped dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  struct Entry {
    std::uint64_t number;
    std::size_t bytes;
    Item item;
  };

  [[nodiscard]] std::deque<Entry>& queue(RecordClass what) noexcept {
    return queues_[static_cast<std::size_t>(what)];
  }
  [[nodiscard]] Entry take(std::deque<Entry>& from) {
    Entry entry = std::move(from.front());
    from.pop_front();
    bytes_ -= entry.bytes;
    if (&from == &queue(RecordClass::kEvent)) event_bytes_ -= entry.bytes;
    return entry;
  }
  /// The queue whose first item came first of all; null where all are empty.
  template <class Self>
  [[nodiscard]] static auto oldest_of(Self& self) noexcept {
    decltype(&self.queues_[0]) found = nullptr;
    for (auto& queue : self.queues_) {
      if (queue.empty()) continue;
      if (found == nullptr || queue.front().number < found->front().number) found = &queue;
    }
    return found;
  }
  [[nodiscard]] std::deque<Entry>* oldest() noexcept { return oldest_of(*this); }
  [[nodiscard]] const std::deque<Entry>* oldest() const noexcept { return oldest_of(*this); }

  const std::size_t most_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::array<std::deque<Entry>, 4> queues_;  ///< By class.
  std::uint64_t next_ = 0;
  std::size_t bytes_ = 0;
  std::size_t event_bytes_ = 0;
  bool is_closed_ = false;
  Dropped dropped_;
};

}  // namespace sidestep
