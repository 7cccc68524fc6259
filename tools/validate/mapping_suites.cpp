#include "conformance/field_conformance.hpp"
#include "conformance/localiser_conformance.hpp"
#include "conformance/mapper_conformance.hpp"
#include "conformance/source_conformance.hpp"

#include "subject.hpp"

namespace sidestep::conformance {
namespace {

using validate::cases_of;
using validate::subject;

/// What the field says of itself after the first update.
FieldInfo first_info(FieldBuilder& builder) {
  GridMap map({Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(16, 16, 16)});
  map.set({8, 8, 8}, true);
  if (const auto attached = builder.attach(map); !attached) {
    throw std::runtime_error(attached.error().describe());
  }
  const auto field = builder.update(map.take_update());
  if (!field) throw std::runtime_error(field.error().describe());
  return (*field)->info();
}

FieldCase field_case() {
  const FieldInfo info = first_info(*subject()->make<FieldBuilder>());
  FieldCase field;
  field.create = [](WorkerPool& workers) { return subject()->make<FieldBuilder>({}, &workers); };
  field.is_signed = info.is_signed;
  field.max_distance_m = info.max_distance_m;
  field.max_error_m = subject()->expect().max_error_m;
  field.unknown_is_occupied = subject()->expect().unknown_is_occupied;
  return field;
}
INSTANTIATE_TEST_SUITE_P(plugin, FieldConformance,
                         testing::ValuesIn(cases_of(PluginKind::kField, field_case)));

MapperCase mapper_case() {
  return {.name = {},
          .create = [](WorkerPool& workers) { return subject()->make<Mapper>({}, &workers); },
          .takes_clouds = subject()->expect().takes_clouds};
}
INSTANTIATE_TEST_SUITE_P(plugin, MapperConformance,
                         testing::ValuesIn(cases_of(PluginKind::kMapper, mapper_case)));

LocaliserCase localiser_case() {
  return {.name = {},
          .make = [](auto robot) { return subject()->make<Localiser>({.robot = robot}); },
          .moves_freely = subject()->expect().moves_freely};
}
INSTANTIATE_TEST_SUITE_P(plugin, LocaliserConformance,
                         testing::ValuesIn(cases_of(PluginKind::kLocaliser, localiser_case)));

SourceCase source_case() {
  return {.name = {},
          .make = [](const Clock& clock) { return subject()->make<Source>({.clock = &clock}); },
          .is_live = subject()->expect().is_live,
          .truth_error_m = subject()->expect().truth_error_m};
}
INSTANTIATE_TEST_SUITE_P(plugin, SourceConformance,
                         testing::ValuesIn(cases_of(PluginKind::kSource, source_case)));

}  // namespace
}  // namespace sidestep::conformance
