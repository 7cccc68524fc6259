#include <sidestep/plugin/map_options.hpp>

#include <unistd.h>

#include <cmath>
#include <limits>

namespace sidestep {
namespace {

std::string text(double value) { return detail::number_text(value); }

}  // namespace

tl::unexpected<Error> wrong_parameter(const std::string& parameter, const std::string& what,
                                      const std::string& mapper, std::string hint) {
  return fail(ErrorCode::kConfig, parameter + " " + what, "mapper " + mapper, std::move(hint));
}

double voxels_of_blocks(const MapOptions& options) {
  const Eigen::Array3d blocks = (options.size_vox.cast<double>() / kBlockSide_vox).array().ceil();
  return blocks.prod() * kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
}

Result<void> check_map_options(const MapOptions& options, double needed_mib,
                               const std::string& mapper) {
  const auto wrong = [&](const std::string& parameter, const std::string& what,
                         std::string hint = {}) {
    return wrong_parameter(parameter, what, mapper, std::move(hint));
  };
  if (!std::isfinite(options.resolution_m) || options.resolution_m <= 0.0) {
    return wrong("resolution_m", "must be above 0, not " + text(options.resolution_m));
  }
  if (!options.origin_m.allFinite()) return wrong("origin_m", "must be finite");
  if (options.size_vox.minCoeff() <= 0) {
    return wrong("size_vox", "must be above 0 along each axis, not " +
                                 std::to_string(options.size_vox.minCoeff()));
  }
  constexpr double kMebibyte = 1 << 20;
  const double installed_mib = static_cast<double>(sysconf(_SC_PHYS_PAGES)) *
                               static_cast<double>(sysconf(_SC_PAGE_SIZE)) / kMebibyte;
  const double blocks =
      voxels_of_blocks(options) / (kBlockSide_vox * kBlockSide_vox * kBlockSide_vox);
  if (needed_mib > installed_mib || blocks > std::numeric_limits<int>::max()) {
    return wrong("size_vox",
                 "asks for a map of " + text(std::ceil(needed_mib)) + " MiB, this machine has " +
                     text(std::floor(installed_mib)) + " MiB",
                 "choose a smaller size_vox or a larger resolution_m");
  }
  if (!(options.min_range_m >= 0.0)) {
    return wrong("min_range_m", "must not be negative, it is " + text(options.min_range_m));
  }
  if (!std::isfinite(options.max_range_m) || !(options.max_range_m > options.min_range_m)) {
    return wrong("max_range_m",
                 "must be finite and above min_range_m, it is " + text(options.max_range_m));
  }
  if (!std::isfinite(options.floor_z_m)) return wrong("floor_z_m", "must be finite");
  if (!std::isfinite(options.floor_clearance_m)) {
    return wrong("floor_clearance_m", "must be finite");
  }
  if (!std::isfinite(options.self_filter_margin_m) || options.self_filter_margin_m < 0.0) {
    return wrong("self_filter_margin_m",
                 "must not be negative, it is " + text(options.self_filter_margin_m));
  }
  return {};
}

}  // namespace sidestep
