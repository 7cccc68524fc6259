#pragma once

#include <nlohmann/json.hpp>

namespace sidestep::testing_support {

/// Recorded problems that can be solved by hand: a disc of 0.1 m on a plane, from (-1, 0) to (1,
/// 0),
/// (-1, 1) to (1, 1), and (-1, 0) to (-1, 1), each in an empty scene and in one with a square of
/// 0.4 m around the origin that costs next to nothing, so that all motions are straight. From rest
/// to rest over a distance D in T = 5 s the prior then costs 6 D^2 / T^3: 0.192, 0.192 and 0.048.
/// The first motion is in collision in the second scene. The peer's costs are made up: those, but
/// for the last problem, where the peer is 10 % better. So is which of its solutions are free: four
/// of six.
[[nodiscard]] inline nlohmann::json recorded_disc() {
  using Json = nlohmann::json;
  const auto rows = [] {
    Json all = Json::array();
    for (const int scene : {0, 1}) {
      for (const int pair : {0, 1, 2}) {
        const double cost = (pair == 2 ? 0.048 : 0.192) * (scene == 1 && pair == 2 ? 0.9 : 1.0);
        const int is_free = pair != 0;
        all.push_back({scene, pair, 3, 1e6, cost, is_free, is_free, 2000.0, 1500.0});
      }
    }
    return all;
  };
  const auto run = [&](const char* label, const char* field, double tolerance, int iterations) {
    return Json{{"label", label},
                {"field", field},
                {"rel_tol", tolerance},
                {"max_iter", iterations},
                {"results", rows()}};
  };
  return {{"robot", {{"name", "disc"}, {"spheres", {{0, 0.0, 0.0, 0.0, 0.1}}}}},
          {"grid", {{"cell", 0.1}, {"n", {61, 41, 1}}, {"origin", {-3.0, -2.0, 0.0}}}},
          {"scenes", {Json::array(), {{{"lo", {-0.2, -0.2, 0.0}}, {"hi", {0.2, 0.2, 0.0}}}}}},
          {"configurations", {{-1.0, 0.0}, {1.0, 0.0}, {-1.0, 1.0}, {1.0, 1.0}}},
          {"pairs", {{0, 1}, {2, 3}, {0, 2}}},
          {"settings",
           {{"states", 6},
            {"total_step", 5},
            {"total_time_s", 5.0},
            {"Qc_diag", 1.0},
            {"obs_check_inter", 3},
            {"epsilon", 0.0},
            {"cost_sigma", 1000.0},
            {"conf_prior_sigma", 1e-4},
            {"vel_prior_sigma", 1e-4},
            {"start_vel", 0},
            {"goal_vel", 0}}},
          {"result_columns",
           {"scene", "pair", "iterations", "initial_cost", "final_cost", "cf_sdf_checked",
            "cf_exact_dense", "cpu_us_total", "cpu_us_optimise"}},
          {"runs", {run("study", "sdf", 1e-5, 100), run("replan", "usdf", 1e-2, 1)}}};
}

}  // namespace sidestep::testing_support
