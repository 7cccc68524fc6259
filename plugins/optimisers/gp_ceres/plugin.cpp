#include <memory>

#include <sidestep/plugin/plugin.hpp>

#include "gp_ceres.hpp"

namespace sidestep {

Parameters<GpCeresSettings> GpCeresSettings::parameters() {
  return Parameters<GpCeresSettings>()
      .add("relative_tolerance", &GpCeresSettings::relative_tolerance,
           "Stop when an accepted step lowers the cost by less than this share of it.",
           {.min = 0.0, .max = 1.0})
      .add("absolute_tolerance", &GpCeresSettings::absolute_tolerance,
           "Stop when an accepted step lowers the cost by less than this.", {.min = 0.0})
      .add("max_iterations", &GpCeresSettings::max_iterations,
           "Stop after this many steps, accepted or not.", {.min = 1.0, .max = 1e6})
      .add("initial_damping", &GpCeresSettings::initial_damping,
           "Damping of the first Levenberg-Marquardt step.", {.min = 1e-12, .max = 1e12});
}

namespace {

Result<std::unique_ptr<Optimiser>> create(const GpCeresSettings& settings, const HostContext&) {
  return make_gp_ceres(settings);
}

}  // namespace
}  // namespace sidestep

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::GpCeresSettings, sidestep::create, "gp_ceres",
                "0.1.0", "GP trajectory optimisation (GPMP2) with Levenberg-Marquardt on Ceres")
