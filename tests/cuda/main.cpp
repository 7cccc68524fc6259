#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <vector>

#include "device_checks.hpp"

/// usage: cuda_check [--times] [DEVICE]
///
/// Checks a CUDA device, 0 by default; with --times, measures it instead. Exit code 0: all is well;
/// 1: something is wrong; 77: there is no device to check.
int main(int argc, char** argv) {
  using namespace sidestep::cuda_checks;
  constexpr int kSkipped = 77;
  bool is_timed = false;
  int ordinal = 0;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--times") == 0) {
      is_timed = true;
    } else {
      ordinal = std::atoi(argv[i]);
    }
  }
  const std::string why = why_unusable(ordinal);
  if (!why.empty()) {
    std::printf("SKIPPED, nothing was checked: %s\n", why.c_str());
    return kSkipped;
  }
  if (is_timed) {
    print_times(ordinal);
    print_chain_times(ordinal);
    return 0;
  }
  int failed = 0;
  std::vector<Check> checks = device_checks(ordinal);
  std::ranges::move(chain_checks(ordinal), std::back_inserter(checks));
  for (const Check& check : checks) {
    const std::string wrong = check.run();
    std::printf("%s %s%s%s\n", wrong.empty() ? "passed" : "FAILED", check.name.c_str(),
                wrong.empty() ? "" : ": ", wrong.c_str());
    std::fflush(stdout);
    failed += wrong.empty() ? 0 : 1;
  }
  std::printf("%d failed\n", failed);
  return failed == 0 ? 0 : 1;
}
