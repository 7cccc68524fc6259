#include "conformance/predictor_conformance.hpp"

#include "predictor_loader.hpp"

namespace sidestep::conformance {
namespace {

PredictorCase loaded(const std::string& name, const std::string& parameters = {}) {
  const std::string block = "{plugin: " + name + parameters + "}";
  return {name + (parameters.empty() ? "" : "_told"), [block] {
            SceneObject walker;
            walker.shape = Cylinder{0.3, 1.8};
            walker.waypoints = {{0.0, Transform::Identity()}, {9.0, Transform::Identity()}};
            walker.waypoints[1].T_world_object.translation().x() = 4.0;
            return testing_support::load_predictor(
                block, std::make_shared<const Scene>(std::vector{walker}));
          }};
}

INSTANTIATE_TEST_SUITE_P(
    plugins, PredictorConformance,
    testing::Values(loaded("constant_velocity"),
                    loaded("constant_velocity", ", step_s: 1.7, sigmas: 3, max_growth_m: 100"),
                    loaded("goal_directed"), loaded("motion_patterns"), loaded("none"),
                    loaded("orca"), loaded("orca", ", sees_robot: true, step_s: 0.1"),
                    loaded("truth"), loaded("worst_case")),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
