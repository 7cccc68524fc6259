// What plugins declare of views against what their objects are.

#include <algorithm>

#include <gtest/gtest.h>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>

#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using testing_support::HostFixture;

/// Checks one view of a mapper: declared if, and only if, the object has it.
template <class View>
void expect_as_declared(const PluginInfo& info, const Mapper& mapper) {
  const bool is_declared = std::ranges::find(info.views, View::kViewName) != info.views.end();
  EXPECT_EQ(is_declared, dynamic_cast<const View*>(&mapper) != nullptr)
      << info.name << ": " << View::kViewName;
}

/// A block for a plugin; one that needs a GPU goes on without where there is none.
Node block_for(const PluginInfo& info, const std::string& options) {
  const bool falls_back = std::ranges::any_of(
      info.schema, [](const Parameter& parameter) { return parameter.name == "fallback"; });
  return HostFixture::block("{plugin: " + info.name + ", " + options +
                            (falls_back ? ", fallback: cpu}" : "}"));
}

const std::string kSmallGrid = "resolution_m: 0.1, size_vox: [32, 32, 16]";

TEST(Views, EveryMapperHasThoseThatItDeclares) {
  HostFixture fixture({PLUGIN_FOLDER});
  int mappers = 0;
  for (const PluginInfo& info : fixture.host.plugins()) {
    if (info.kind != PluginKind::kMapper) continue;
    ++mappers;
    const auto mapper = fixture.host.create<Mapper>(block_for(info, kSmallGrid));
    ASSERT_TRUE(mapper) << mapper.error().describe();
    expect_as_declared<OccupancyView>(info, **mapper);
    expect_as_declared<OctreeView>(info, **mapper);
    expect_as_declared<TsdfView>(info, **mapper);
  }
  EXPECT_GE(mappers, 2);
}

TEST(Views, AFieldThatDeclaresItsNeedsAttachesToTheMappersThatMeetThem) {
  HostFixture fixture({PLUGIN_FOLDER});
  const auto plugins = fixture.host.plugins();
  for (const PluginInfo& field_info : plugins) {
    if (field_info.kind != PluginKind::kField) continue;
    for (const PluginInfo& mapper_info : plugins) {
      if (mapper_info.kind != PluginKind::kMapper) continue;
      const Node mapper_block = block_for(mapper_info, kSmallGrid);
      auto mapper = fixture.host.create<Mapper>(mapper_block);
      auto field = fixture.host.create<FieldBuilder>(block_for(field_info, "unknown: free"));
      ASSERT_TRUE(mapper && field);
      std::vector<Error> errors;
      fixture.host.check_views(mapper_block, field_info.views, "the field", errors);
      EXPECT_EQ(errors.empty(), (*field)->attach(**mapper).has_value())
          << field_info.name << " on " << mapper_info.name;
    }
  }
}

TEST(Views, AMapperThatLacksOneIsNamedWithThoseThatDoNot) {
  HostFixture fixture({PLUGIN_FOLDER});
  std::vector<Error> errors;
  fixture.host.check_views(HostFixture::block("{plugin: voxel_grid}"), {"octree"}, "the field 'f'",
                           errors);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].describe(),
            "test.yaml:1:10: the field 'f' needs a mapper that offers its octree, and 'voxel_grid' "
            "does not (mappers that do: octomap)");
}

}  // namespace
}  // namespace sidestep
