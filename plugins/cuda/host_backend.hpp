#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include <sidestep/core/error.hpp>

#include "cuda/kernel.hpp"

namespace sidestep::cuda {

/// Memory of a backend: the device's, or the host's own. Owns it.
template <class T>
class Memory {
 public:
  using Free = void (*)(void*);

  Memory() : data_(nullptr, [](void*) {}) {}
  Memory(T* data, std::size_t size, Free free) : data_(data, free), size_(size) {}

  [[nodiscard]] T* data() noexcept { return data_.get(); }
  [[nodiscard]] const T* data() const noexcept { return data_.get(); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
};

/// Memory anew; fails where the backend has no more, and then holds none.
template <class Backend, class T>
Result<void> renew(Backend& backend, Memory<T>& memory, std::size_t count) {
  memory = {};  // given back first: both may not fit
  memory = SIDESTEP_TRY(backend.template allocate<T>(count));
  return {};
}

/// Makes room for at least so much, at first for no more, then by doubling; what it held is lost
/// where it grows.
template <class Backend, class T>
Result<void> grow(Backend& backend, Memory<T>& memory, std::size_t count) {
  if (memory.size() >= count) return {};
  return renew(backend, memory, std::max(count, 2 * memory.size()));
}

/// The same of the host's memory that the device reads and writes directly.
template <class Backend, class T>
Result<void> grow_pinned(Backend& backend, Memory<T>& memory, std::size_t count) {
  if (memory.size() >= count) return {};
  memory = SIDESTEP_TRY(backend.template allocate_pinned<T>(std::max(count, 2 * memory.size())));
  return {};
}

/// The parts of an update as the paper's breakdown has them (Finean 2021, Sec. VI).
enum class Stage { kUpload, kIntegrate, kTransform, kDownload };
inline constexpr std::size_t kStages = 4;

/// How long each took in the newest update, in milliseconds; 0 for those that it had none of.
struct StageTimes {
  std::array<double, kStages> ms{};

  [[nodiscard]] double of(Stage stage) const noexcept {
    return ms[static_cast<std::size_t>(stage)];
  }
};

/// Runs kernels on the host, one thread after the other: what tests hold the device against, and
/// what they run where there is none. The same interface as DeviceBackend, which documents it.
class HostBackend {
 public:
  static constexpr int kOrdinal = -1;

  /// Allocations beyond `memory_bytes` fail, as a device's do.
  explicit HostBackend(Order order = Order::kForward,
                       std::size_t memory_bytes = std::numeric_limits<std::size_t>::max())
      : order_(order), bytes_left_(memory_bytes) {}

  [[nodiscard]] int ordinal() const noexcept { return kOrdinal; }

  template <class T>
  [[nodiscard]] Result<Memory<T>> allocate(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t bytes = count * sizeof(T);
    if (bytes > bytes_left_) {
      return fail(ErrorCode::kUnsupported, "the device's memory is too small", "host");
    }
    bytes_left_ -= bytes;
    return Memory<T>(static_cast<T*>(std::calloc(std::max<std::size_t>(count, 1), sizeof(T))),
                     count, &std::free);
  }
  template <class T>
  [[nodiscard]] Result<Memory<T>> allocate_pinned(std::size_t count) {
    return Memory<T>(static_cast<T*>(std::calloc(std::max<std::size_t>(count, 1), sizeof(T))),
                     count, &std::free);
  }

  void enter() {
    times_ = {};
    is_in_stage_ = false;
  }
  void stage(Stage stage) {
    leave_stage();
    stage_ = stage;
    begin_ = Clock::now();
    is_in_stage_ = true;
  }

  template <class T>
  void upload(Memory<T>& to, std::size_t at, std::span<const T> from) {
    std::copy(from.begin(), from.end(), to.data() + at);
  }
  template <class T>
  void download(std::span<T> to, const Memory<T>& from, std::size_t at) {
    std::copy_n(from.data() + at, to.size(), to.begin());
  }
  template <class T>
  void clear(Memory<T>& memory) {
    std::fill_n(memory.data(), memory.size(), T{});
  }
  template <class Kernel>
  void launch(const Kernel& kernel, std::int64_t blocks) {
    run_on_host(kernel, blocks, order_);
  }

  [[nodiscard]] Result<void> finish() {
    leave_stage();
    is_in_stage_ = false;
    return {};
  }
  [[nodiscard]] const StageTimes& times() const noexcept { return times_; }

 private:
  using Clock = std::chrono::steady_clock;

  void leave_stage() {
    if (!is_in_stage_) return;
    const std::chrono::duration<double, std::milli> passed = Clock::now() - begin_;
    times_.ms[static_cast<std::size_t>(stage_)] += passed.count();
  }

  Order order_;
  std::size_t bytes_left_;
  StageTimes times_;
  Stage stage_ = Stage::kUpload;
  Clock::time_point begin_;
  bool is_in_stage_ = false;
};

}  // namespace sidestep::cuda
