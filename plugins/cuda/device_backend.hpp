#pragma once

#include <cuda_runtime.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>

#include "cuda/host_backend.hpp"

namespace sidestep::cuda {

#if defined(__CUDACC__)
namespace detail {

template <class Kernel, int kPhase>
__device__ void run_phases_on_device(const Kernel& kernel, std::int64_t block,
                                     typename Kernel::Shared& shared) {
  kernel.template run<kPhase>(block, static_cast<int>(threadIdx.x), shared);
  if constexpr (kPhase + 1 < Kernel::kPhases) {
    __syncthreads();
    run_phases_on_device<Kernel, kPhase + 1>(kernel, block, shared);
  }
}

template <class Kernel>
__global__ void __launch_bounds__(Kernel::kThreads)
    run_on_device(const Kernel kernel, std::int64_t blocks) {
  __shared__ typename Kernel::Shared shared;
  for (std::int64_t block = blockIdx.x; block < blocks; block += gridDim.x) {
    if constexpr (TeamKernel<Kernel>) {
      Team team;
      kernel.run(block, team, shared);
      __syncthreads();
    } else {
      run_phases_on_device<Kernel, 0>(kernel, block, shared);
      if constexpr (Kernel::kPhases > 1) __syncthreads();
    }
  }
}

}  // namespace detail
#endif

/// A kernel that does nothing, compiled as all others are: whether the device has code for it tells
/// whether it has any for them.
[[nodiscard]] const void* probe_kernel();

/// One CUDA device as kernels and what drives them need it: memory, two streams (one computes, one
/// copies back to the host meanwhile) and the times of stages. For one thread at a time.
///
/// What fails between enter() and finish() is kept, and finish() returns it; what follows the first
/// failure does nothing.
class DeviceBackend {
 public:
  /// Fails with kPlugin where there is no device of this number, no driver, or no code in this
  /// build for the device's architecture.
  [[nodiscard]] static Result<std::unique_ptr<DeviceBackend>> open(int ordinal);
  ~DeviceBackend();
  DeviceBackend(const DeviceBackend&) = delete;
  DeviceBackend& operator=(const DeviceBackend&) = delete;

  [[nodiscard]] int ordinal() const noexcept { return ordinal_; }

  /// Memory of the device, all zeros. Fails with kUnsupported where too little is left.
  template <class T>
  [[nodiscard]] Result<Memory<T>> allocate(std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    auto bytes = SIDESTEP_TRY(allocate_bytes(count, sizeof(T)));
    return Memory<T>(static_cast<T*>(bytes), count, &free_device);
  }
  /// Pinned memory of the host, which copies to and from the device pass without a detour.
  template <class T>
  [[nodiscard]] Result<Memory<T>> allocate_pinned(std::size_t count) {
    auto bytes = SIDESTEP_TRY(allocate_pinned_bytes(count, sizeof(T)));
    return Memory<T>(static_cast<T*>(bytes), count, &free_pinned);
  }

  /// Begins an update, on whatever thread calls; forgets the times of the one before.
  void enter();
  /// What is asked for from here on belongs to this stage.
  void stage(Stage stage);

  /// Copies to the device, in the order of launches. `from` stays as it is until finish().
  template <class T>
  void upload(Memory<T>& to, std::size_t at, std::span<const T> from) {
    copy_in(to.data() + at, from.data(), from.size_bytes());
  }
  /// Copies to the host what the launches so far leave; launches that follow need not wait for it,
  /// and must not change it. There after finish().
  template <class T>
  void download(std::span<T> to, const Memory<T>& from, std::size_t at) {
    copy_out(to.data(), from.data() + at, to.size_bytes());
  }
  template <class T>
  void clear(Memory<T>& memory) {
    clear_bytes(memory.data(), memory.size() * sizeof(T));
  }
#if defined(__CUDACC__)  // for .cu files
  template <class Kernel>
  void launch(const Kernel& kernel, std::int64_t blocks) {
    if (error_ || blocks <= 0) return;
    const auto grid = static_cast<unsigned>(least_of<std::int64_t>(blocks, 0x7fffffff));
    detail::run_on_device<Kernel><<<grid, Kernel::kThreads, 0, compute_>>>(kernel, blocks);
    check(cudaGetLastError(), "a kernel could not be launched");
  }
#endif

  /// Waits for all that was asked for. Fails with kPlugin, naming what went wrong first: out of
  /// memory, a failed launch, a device lost.
  [[nodiscard]] Result<void> finish();
  /// Of the update that finish() has ended.
  [[nodiscard]] const StageTimes& times() const noexcept { return times_; }

 private:
  explicit DeviceBackend(int ordinal) : ordinal_(ordinal) {}
  [[nodiscard]] Result<void> prepare();
  [[nodiscard]] Result<void*> allocate_bytes(std::size_t count, std::size_t each);
  [[nodiscard]] Result<void*> allocate_pinned_bytes(std::size_t count, std::size_t each);
  void copy_in(void* to, const void* from, std::size_t bytes);
  void copy_out(void* to, const void* from, std::size_t bytes);
  void clear_bytes(void* memory, std::size_t bytes);
  void check(cudaError_t status, const char* what);
  static void free_device(void* memory);
  static void free_pinned(void* memory);

  /// What begins where.
  struct Mark {
    Stage stage;
    cudaEvent_t begin;
  };
  [[nodiscard]] cudaEvent_t next_event();

  int ordinal_;
  cudaStream_t compute_ = nullptr;
  cudaStream_t copy_ = nullptr;
  std::vector<cudaEvent_t> events_;  ///< With times.
  std::size_t events_used_ = 0;
  cudaEvent_t computed_ = nullptr;  ///< Without.
  cudaEvent_t copied_ = nullptr;
  std::vector<Mark> marks_;
  StageTimes times_;
  std::optional<Error> error_;
};

}  // namespace sidestep::cuda
