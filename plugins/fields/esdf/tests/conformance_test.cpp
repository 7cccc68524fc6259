#include <cmath>

#include "conformance/field_conformance.hpp"
#include "esdf_field.hpp"
#include "tsdf_grid_map.hpp"

namespace sidestep::conformance {
namespace {

constexpr double kCaseLimit_m = 0.4;

/// How much longer a path of straight and diagonal steps can be than the straight line: most along
/// (1, sqrt(2) - 1, sqrt(3) - sqrt(2)). In the plane it is the 8 % of Oleynikova et al. 2017.
/// Values near surfaces are exact, and every step towards the nearest obstacle adds no more than
/// its length, with either kind of propagation.
double max_error_m() {
  const double b = std::sqrt(2.0) - 1.0;
  const double c = std::sqrt(3.0) - std::sqrt(2.0);
  return (std::sqrt(1.0 + b * b + c * c) - 1.0) * kCaseLimit_m + 1e-6;
}

FieldCase esdf_case(const std::string& propagation, const std::string& unknown, bool is_signed) {
  FieldCase field;
  field.name = propagation + "_unknown_" + unknown + (is_signed ? "_signed" : "_unsigned");
  field.is_signed = is_signed;
  field.unknown_is_occupied = unknown == "occupied";
  field.max_distance_m = kCaseLimit_m;
  field.max_error_m = max_error_m();
  esdf::Options options;
  options.is_signed = is_signed;
  options.max_distance_m = kCaseLimit_m;
  options.unknown = unknown;
  options.propagation = propagation;
  options.min_change_m = 0.0;
  field.create = [options](WorkerPool& workers) {
    return esdf::make_esdf_builder(options, workers);
  };
  field.create_map = [=](const GridSpec& grid) {
    return std::make_unique<TsdfGridMap>(grid, unknown == "occupied");
  };
  return field;
}

INSTANTIATE_TEST_SUITE_P(esdf, FieldConformance,
                         testing::Values(esdf_case("quasi_euclidean", "free", true),
                                         esdf_case("quasi_euclidean", "occupied", true),
                                         esdf_case("quasi_euclidean", "free", false),
                                         esdf_case("full_euclidean", "free", true),
                                         esdf_case("full_euclidean", "occupied", true)),
                         [](const testing::TestParamInfo<FieldCase>& tested) {
                           return tested.param.name;
                         });

}  // namespace
}  // namespace sidestep::conformance
