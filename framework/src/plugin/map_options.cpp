#include <sidestep/plugin/map_options.hpp>

#include <unistd.h>

#include <cmath>
#include <limits>

namespace sidestep {

double voxels_of_blocks(const MapOptions& options) {
  const Eigen::Array3d blocks = (options.size_vox.cast<double>() / kBlockSide_vox).array().ceil();
  return blocks.prod() * kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
}

std::vector<OptionMistake> check_map_options(const MapOptions& options, double needed_mib) {
  using detail::number_text;
  std::vector<OptionMistake> mistakes;
  constexpr double kMebibyte = 1 << 20;
  const double installed_mib = static_cast<double>(sysconf(_SC_PHYS_PAGES)) *
                               static_cast<double>(sysconf(_SC_PAGE_SIZE)) / kMebibyte;
  const double blocks =
      voxels_of_blocks(options) / (kBlockSide_vox * kBlockSide_vox * kBlockSide_vox);
  if (needed_mib > installed_mib || blocks > std::numeric_limits<int>::max()) {
    mistakes.push_back({{"size_vox"},
                        "asks for a map of " + number_text(std::ceil(needed_mib)) +
                            " MiB, this machine has " + number_text(std::floor(installed_mib)) +
                            " MiB",
                        "choose a smaller size_vox or a larger resolution_m"});
  }
  if (!(options.max_range_m > options.min_range_m)) {
    mistakes.push_back({{"max_range_m", "min_range_m"},
                        "must be above min_range_m, but " + number_text(options.max_range_m) +
                            " <= " + number_text(options.min_range_m),
                        {}});
  }
  return mistakes;
}

}  // namespace sidestep
