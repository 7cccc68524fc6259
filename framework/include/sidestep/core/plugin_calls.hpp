#pragma once

#include <array>
#include <atomic>
#include <cfenv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace sidestep {

/// A text of limited length, in memory that processes share: its owner writes, others read it when
/// the owner waits or is dead. What is too long loses its beginning.
template <std::size_t kLength>
class SharedText {
 public:
  void set(std::string_view text) noexcept {
    if (text.size() >= kLength) text.remove_prefix(text.size() - (kLength - 1));
    text.copy(text_.data(), text.size());
    text_[text.size()] = '\0';
  }
  [[nodiscard]] std::string_view view() const noexcept { return text_.data(); }

 private:
  std::array<char, kLength> text_{};
};

/// Which plugins the threads of a process are in: what whoever outlives the process needs to say
/// where it ended. Its texts are those of the last to write; zeroes are a board of nothing.
struct PluginBoard {
  struct Call {
    SharedText<96> plugin;  ///< Kind and name.
    std::int64_t since_ns = 0;
  };
  struct Thread {
    std::atomic<int> depth;     ///< Calls within each other.
    std::array<Call, 8> calls;  ///< The first of them; the innermost is the last.
  };
  std::atomic<std::uint64_t> taken;  ///< A bit for each of `threads`.
  std::array<Thread, 64> threads;    ///< Others leave nothing.
  /// The thread that a signal ended, counted from 1; -1: one that was in no plugin ever; 0: nobody
  /// knows.
  std::atomic<int> faulty;
  std::atomic<std::int64_t> frames;  ///< The sequence of the last frame that was mapped, plus 1.
  SharedText<1024> opening;          ///< A library, while it is being opened.
  std::atomic<std::int64_t> opening_since_ns;
  SharedText<128> harm;         ///< What it did to the process, which ends for that.
  SharedText<1024> run;         ///< Where the run's results go, once there are any.
  std::atomic<bool> has_ended;  ///< By itself; then `exit_code` is its own.
  std::atomic<int> exit_code;

  int foreign_count = 0;  ///< Opened libraries that the installation does not hold.
  SharedText<1024> last_foreign;
  bool refuses_foreign = false;

  /// Somebody waits for the process, and begins it anew without a library that did it harm.
  bool is_watched = false;
  /// Libraries that are not opened any more.
  struct Refusal {
    SharedText<1024> library;
    SharedText<128> reason;
  };
  int refusal_count = 0;
  std::array<Refusal, 32> refusals;

  /// Nothing but what is refused is left. [main], while no other process uses it.
  void forget_calls() noexcept;
};

/// That of this process. [any]
[[nodiscard]] PluginBoard& plugin_board() noexcept;

/// Puts an empty board where the children of fork() will write to it, too, and has fatal signals
/// leave the thread there that they end, unless something else handles them. To be called before
/// any thread and any plugin; null where there is no memory. [main]
[[nodiscard]] PluginBoard* share_plugin_board() noexcept;

/// Nanoseconds of the clock of PluginBoard, in steps of some milliseconds.
[[nodiscard]] std::int64_t board_time_ns() noexcept;

/// Rounding, denormals and traps of this thread, as they were when it ends. [any]
class FloatingPointGuard {
 public:
  FloatingPointGuard() noexcept;
  ~FloatingPointGuard();
  FloatingPointGuard(const FloatingPointGuard&) = delete;
  FloatingPointGuard& operator=(const FloatingPointGuard&) = delete;

 private:
#if defined(__x86_64__)
  std::uint32_t mxcsr_;
  std::uint16_t x87_;
#else
  std::fenv_t before_;
#endif
};

/// A call into a plugin, on the board while it lasts. What it does to the processor's rounding ends
/// with it. [any]
class PluginCall {
 public:
  explicit PluginCall(std::string_view plugin) noexcept;
  ~PluginCall();
  /// The innermost of this thread, while it lasts; empty where there is none. Work that is handed
  /// to other threads (WorkerPool) is noted there as this one's.
  [[nodiscard]] static std::string_view current() noexcept;
  PluginCall(const PluginCall&) = delete;
  PluginCall& operator=(const PluginCall&) = delete;

 private:
  PluginBoard::Thread* thread_;  ///< Null where the board is full.
  FloatingPointGuard rounding_;
};

}  // namespace sidestep
