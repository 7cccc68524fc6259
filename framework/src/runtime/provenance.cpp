#include <fstream>
#include <thread>

#include <sidestep/runtime/library_version.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "provenance_config.hpp"  // written by cmake/WriteProvenance.cmake at every build

namespace sidestep {
namespace {

std::string cpu_model() {
  std::ifstream info("/proc/cpuinfo");
  std::string line;
  while (std::getline(info, line)) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && colon + 2 < line.size()) return line.substr(colon + 2);
  }
  return "unknown CPU";
}

}  // namespace

const char* library_version() noexcept { return SIDESTEP_VERSION; }

RunProvenance current_provenance() {
  RunProvenance provenance;
  provenance.version = SIDESTEP_VERSION;
  provenance.git_hash = SIDESTEP_GIT_HASH;
  provenance.build_flags = std::string("g++ ") + __VERSION__ + ", " + SIDESTEP_BUILD_FLAGS;
#if defined(__clang__)
  provenance.build_flags = std::string(__VERSION__) + ", " + SIDESTEP_BUILD_FLAGS;
#endif
  const unsigned cores = std::thread::hardware_concurrency();
  provenance.cpu = cpu_model() + ", " + std::to_string(cores) + " cores";
  provenance.threads = static_cast<int>(cores);
  return provenance;
}

}  // namespace sidestep
