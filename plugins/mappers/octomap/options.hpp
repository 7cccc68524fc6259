#pragma once

#include <vector>

#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::octomap_mapper {

/// The sensor model's defaults are OctoMap's own (Hornung 2013, Sec. 3.2).
struct OctomapOptions : MapOptions {
  OctomapOptions() {
    resolution_m = 0.05;
    size_vox = {160, 160, 64};
  }

  double prob_hit = 0.7;
  double prob_miss = 0.4;
  double clamp_min = 0.1192;
  double clamp_max = 0.971;
  double occupied_at = 0.5;

  static Parameters<OctomapOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

}  // namespace sidestep::octomap_mapper
