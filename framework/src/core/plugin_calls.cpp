#include <sidestep/core/plugin_calls.hpp>

#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <csignal>
#include <cstddef>
#include <ctime>
#include <memory>
#include <new>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace sidestep {
namespace {

PluginBoard own_board;  // zeroes
std::atomic<PluginBoard*> board = &own_board;
std::atomic<bool> hears_signals = false;

/// Enough for hear_fault() and what the system puts on a stack of signals.
constexpr std::size_t kSignalStack_bytes = 64 * 1024;

/// A thread's place on the board, and a stack for the signal that says that its own is full.
class Place {
 public:
  Place() noexcept {
    std::atomic<std::uint64_t>& taken = board.load()->taken;
    std::uint64_t before = taken.load();
    while (~before != 0) {
      const int free = std::countr_one(before);
      if (!taken.compare_exchange_weak(before, before | std::uint64_t{1} << free)) continue;
      index_ = free;
      thread()->depth = 0;
      break;
    }
    if (!hears_signals) return;
    stack_.reset(new (std::nothrow) std::byte[kSignalStack_bytes]);
    if (!stack_) return;
    const stack_t stack{stack_.get(), 0, kSignalStack_bytes};
    sigaltstack(&stack, nullptr);
  }
  ~Place() {
    if (stack_) {
      const stack_t none{nullptr, SS_DISABLE, 0};
      sigaltstack(&none, nullptr);
    }
    if (index_ >= 0) board.load()->taken &= ~(std::uint64_t{1} << index_);
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

  [[nodiscard]] int index() const noexcept { return index_; }
  [[nodiscard]] PluginBoard::Thread* thread() const noexcept {
    return index_ < 0 ? nullptr : &board.load()->threads[static_cast<std::size_t>(index_)];
  }

 private:
  int index_ = -1;
  std::unique_ptr<std::byte[]> stack_;
};

thread_local int place_of_thread = -1;  // for hear_fault(), which must not make one

Place& place() noexcept {
  thread_local Place own;
  place_of_thread = own.index();
  return own;
}

/// Leaves which thread it is, and has the signal come again, by default (SA_RESETHAND).
void hear_fault(int signal) noexcept {
  int unknown = 0;
  const int own = place_of_thread < 0 ? -1 : place_of_thread + 1;
  board.load()->faulty.compare_exchange_strong(unknown, own);
  std::raise(signal);
}

}  // namespace

void PluginBoard::forget_calls() noexcept {
  taken = 0;
  faulty = 0;
  frames = 0;
  opening.set("");
  opening_since_ns = 0;
  harm.set("");
  foreign_count = 0;
  run.set("");
}

PluginBoard& plugin_board() noexcept { return *board.load(); }

PluginBoard* share_plugin_board() noexcept {
  void* const memory =
      mmap(nullptr, sizeof(PluginBoard), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return nullptr;
  board = new (memory) PluginBoard{};
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS}) {
    struct sigaction action {};
    sigaction(signal, nullptr, &action);
    if (action.sa_handler != SIG_DFL) continue;  // a sanitizer's
    action.sa_handler = &hear_fault;
    action.sa_flags = SA_ONSTACK | SA_RESETHAND;
    sigaction(signal, &action, nullptr);
    hears_signals = true;
  }
  return board.load();
}

std::int64_t board_time_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

#if defined(__x86_64__)
// <cfenv> takes ten times as long as the rest of a PluginCall.

namespace {

std::uint16_t x87_control() noexcept {
  std::uint16_t word = 0;
  asm volatile("fnstcw %0" : "=m"(word));
  return word;
}

}  // namespace

FloatingPointGuard::FloatingPointGuard() noexcept : mxcsr_(_mm_getcsr()), x87_(x87_control()) {}

FloatingPointGuard::~FloatingPointGuard() {
  constexpr std::uint32_t kRaised = 0x3f;  // exceptions that were: they do no harm
  if (((_mm_getcsr() ^ mxcsr_) & ~kRaised) != 0) _mm_setcsr(mxcsr_);
  if (x87_control() != x87_) asm volatile("fldcw %0" : : "m"(x87_));
}

#else

FloatingPointGuard::FloatingPointGuard() noexcept { std::fegetenv(&before_); }

FloatingPointGuard::~FloatingPointGuard() { std::fesetenv(&before_); }

#endif

PluginCall::PluginCall(std::string_view plugin) noexcept : thread_(place().thread()) {
  if (thread_ == nullptr) return;
  const auto depth = static_cast<std::size_t>(thread_->depth.load(std::memory_order_relaxed));
  if (depth < thread_->calls.size()) {
    thread_->calls[depth].plugin.set(plugin);
    thread_->calls[depth].since_ns = board_time_ns();
  }
  thread_->depth.store(static_cast<int>(depth) + 1, std::memory_order_release);
}

std::string_view PluginCall::current() noexcept {
  const PluginBoard::Thread* const thread = place().thread();
  if (thread == nullptr) return {};
  const int depth = std::min(thread->depth.load(std::memory_order_relaxed),
                             static_cast<int>(thread->calls.size()));
  return depth < 1 ? std::string_view()
                   : thread->calls[static_cast<std::size_t>(depth) - 1].plugin.view();
}

PluginCall::~PluginCall() {
  if (thread_ != nullptr) thread_->depth.fetch_sub(1, std::memory_order_release);
}

}  // namespace sidestep
