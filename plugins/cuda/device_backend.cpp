#include "cuda/device_backend.hpp"

namespace sidestep::cuda {
namespace {

Error device_error(int ordinal, const std::string& what, cudaError_t status) {
  Error error;
  error.code = ErrorCode::kPlugin;
  error.message = what + ": " + cudaGetErrorString(status);
  error.where = "CUDA device " + std::to_string(ordinal);
  return error;
}

std::string mebibytes(std::size_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

/// What there is to say of the driver where no device is found.
std::string about_driver() {
  int driver = 0;
  int runtime = 0;
  if (cudaDriverGetVersion(&driver) != cudaSuccess || driver == 0) {
    return ", for no driver is installed";
  }
  if (cudaRuntimeGetVersion(&runtime) != cudaSuccess || driver >= runtime) return {};
  const auto text = [](int version) {
    return std::to_string(version / 1000) + "." + std::to_string(version % 1000 / 10);
  };
  return ", for the driver is for CUDA " + text(driver) + " and this build for " + text(runtime);
}

/// Whether this build holds code for the current device.
Result<void> check_architecture(int ordinal) {
  cudaFuncAttributes attributes;
  const cudaError_t status = cudaFuncGetAttributes(&attributes, probe_kernel());
  if (status == cudaSuccess) return {};
  cudaGetLastError();
  cudaDeviceProp device;
  if (cudaGetDeviceProperties(&device, ordinal) != cudaSuccess) {
    return tl::make_unexpected(device_error(ordinal, "the device cannot be used", status));
  }
  const std::string architecture = std::to_string(device.major * 10 + device.minor);
  Error error = device_error(ordinal,
                             "this build holds no code for " + std::string(device.name) +
                                 " (architecture " + architecture + ")",
                             status);
  error.hint = "build with -DSIDESTEP_CUDA_ARCHITECTURES=" + architecture;
  return tl::make_unexpected(std::move(error));
}

}  // namespace

Result<std::unique_ptr<DeviceBackend>> DeviceBackend::open(int ordinal) {
  int count = 0;
  const cudaError_t status = cudaGetDeviceCount(&count);
  if (status != cudaSuccess || count == 0) {
    cudaGetLastError();
    return tl::make_unexpected(device_error(ordinal, "no CUDA device can be used" + about_driver(),
                                            status == cudaSuccess ? cudaErrorNoDevice : status));
  }
  if (ordinal < 0 || ordinal >= count) {
    return fail(
        ErrorCode::kPlugin,
        "there is no such device; this machine has " + std::to_string(count) + ", counted from 0",
        "CUDA device " + std::to_string(ordinal));
  }
  std::unique_ptr<DeviceBackend> backend(new DeviceBackend(ordinal));
  SIDESTEP_TRY(backend->prepare());
  return backend;
}

Result<void> DeviceBackend::prepare() {
  check(cudaSetDevice(ordinal_), "the device cannot be used");
  if (error_) return tl::make_unexpected(*error_);
  SIDESTEP_TRY(check_architecture(ordinal_));
  check(cudaStreamCreateWithFlags(&compute_, cudaStreamNonBlocking), "no stream");
  check(cudaStreamCreateWithFlags(&copy_, cudaStreamNonBlocking), "no stream");
  check(cudaEventCreateWithFlags(&computed_, cudaEventDisableTiming), "no event");
  check(cudaEventCreateWithFlags(&copied_, cudaEventDisableTiming), "no event");
  if (error_) return tl::make_unexpected(*error_);
  return {};
}

DeviceBackend::~DeviceBackend() {
  cudaSetDevice(ordinal_);
  for (cudaEvent_t event : events_) cudaEventDestroy(event);
  if (computed_ != nullptr) cudaEventDestroy(computed_);
  if (copied_ != nullptr) cudaEventDestroy(copied_);
  if (compute_ != nullptr) cudaStreamDestroy(compute_);
  if (copy_ != nullptr) cudaStreamDestroy(copy_);
}

Result<void*> DeviceBackend::allocate_bytes(std::size_t count, std::size_t each) {
  const std::size_t bytes = most_of<std::size_t>(count, 1) * each;
  void* memory = nullptr;
  cudaError_t status = cudaSetDevice(ordinal_);
  if (status == cudaSuccess) status = cudaMalloc(&memory, bytes);
  if (status == cudaSuccess) {
    // On the compute stream, or kernels there could run before it.
    status = cudaMemsetAsync(memory, 0, bytes, compute_);
  }
  if (status == cudaSuccess) return memory;
  cudaGetLastError();
  cudaFree(memory);
  if (status != cudaErrorMemoryAllocation) {
    return tl::make_unexpected(device_error(ordinal_, "no memory could be taken", status));
  }
  std::size_t free = 0;
  std::size_t total = 0;
  cudaMemGetInfo(&free, &total);
  Error error = device_error(ordinal_, "the device's memory is too small", status);
  error.code = ErrorCode::kUnsupported;
  error.message += "; " + mebibytes(bytes) + " are needed at once, " + mebibytes(free) + " of " +
                   mebibytes(total) + " are free";
  error.hint = "take a smaller grid, or end what else uses the device";
  return tl::make_unexpected(std::move(error));
}

Result<void*> DeviceBackend::allocate_pinned_bytes(std::size_t count, std::size_t each) {
  const std::size_t bytes = most_of<std::size_t>(count, 1) * each;
  void* memory = nullptr;
  cudaError_t status = cudaSetDevice(ordinal_);
  if (status == cudaSuccess) status = cudaMallocHost(&memory, bytes);
  if (status == cudaSuccess) return memory;
  cudaGetLastError();
  return tl::make_unexpected(device_error(
      ordinal_, mebibytes(bytes) + " of the host's memory could not be pinned", status));
}

void DeviceBackend::free_device(void* memory) { cudaFree(memory); }
void DeviceBackend::free_pinned(void* memory) { cudaFreeHost(memory); }

void DeviceBackend::check(cudaError_t status, const char* what) {
  if (status == cudaSuccess || error_) return;
  cudaGetLastError();  // so that the next call does not report it again
  error_ = device_error(ordinal_, what, status);
}

cudaEvent_t DeviceBackend::next_event() {
  if (events_used_ == events_.size()) {
    cudaEvent_t event = nullptr;
    check(cudaEventCreate(&event), "no event");
    if (error_) return nullptr;
    events_.push_back(event);
  }
  return events_[events_used_++];
}

void DeviceBackend::enter() {
  error_.reset();
  events_used_ = 0;
  marks_.clear();
  times_ = {};
  check(cudaSetDevice(ordinal_), "the device cannot be used");
}

void DeviceBackend::stage(Stage stage) {
  cudaEvent_t begin = next_event();
  if (error_) return;
  // What is still being copied to the host belongs to the stage that ends here.
  check(cudaEventRecord(copied_, copy_), "a stage's end");
  check(cudaStreamWaitEvent(compute_, copied_, 0), "a stage's end");
  check(cudaEventRecord(begin, compute_), "a stage's begin");
  marks_.push_back({stage, begin});
}

void DeviceBackend::copy_in(void* to, const void* from, std::size_t bytes) {
  if (error_ || bytes == 0) return;
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, compute_),
        "copying to the device");
}

void DeviceBackend::copy_out(void* to, const void* from, std::size_t bytes) {
  if (error_ || bytes == 0) return;
  check(cudaEventRecord(computed_, compute_), "copying from the device");
  check(cudaStreamWaitEvent(copy_, computed_, 0), "copying from the device");
  check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, copy_), "copying from the device");
}

void DeviceBackend::clear_bytes(void* memory, std::size_t bytes) {
  if (error_ || bytes == 0) return;
  check(cudaMemsetAsync(memory, 0, bytes, compute_), "clearing the device's memory");
}

Result<void> DeviceBackend::finish() {
  if (!error_ && !marks_.empty()) stage(Stage::kDownload);  // where the last one ends
  if (!error_) {
    check(cudaStreamSynchronize(compute_), "a kernel failed, or the device was lost");
    check(cudaStreamSynchronize(copy_), "copying from the device");
  }
  if (error_) return tl::make_unexpected(*error_);
  for (std::size_t i = 0; i + 1 < marks_.size(); ++i) {
    float ms = 0.0F;
    check(cudaEventElapsedTime(&ms, marks_[i].begin, marks_[i + 1].begin), "a stage's time");
    times_.ms[static_cast<std::size_t>(marks_[i].stage)] += static_cast<double>(ms);
  }
  marks_.clear();
  return {};
}

}  // namespace sidestep::cuda
