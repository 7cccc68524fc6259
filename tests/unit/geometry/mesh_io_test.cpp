#include <cstring>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

class ReadMesh : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("sidestep_read_mesh_" + std::string(info->name()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& content) {
    const auto file = folder_ / name;
    std::ofstream(file, std::ios::binary) << content;
    return file.string();
  }

  std::filesystem::path folder_;
};

template <class T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string binary_stl(const Mesh& mesh, const std::string& header) {
  std::string bytes = header;
  bytes.resize(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) append(bytes, 0.0F);
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        append(bytes, static_cast<float>(
                          mesh.vertices_m[static_cast<std::size_t>(triangle[corner])][axis]));
      }
    }
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

TEST_F(ReadMesh, ReadsBinaryStlAndSharesVertices) {
  const Mesh box = triangulate(Box{{1.0, 2.0, 0.5}});
  for (const std::string header : {"made by hand", "solid box"}) {
    const auto mesh = read_mesh(write("box.STL", binary_stl(box, header)));
    ASSERT_TRUE(mesh) << mesh.error().describe();
    EXPECT_EQ(mesh->vertices_m.size(), 8U);
    EXPECT_EQ(mesh->triangles.size(), 12U);
    EXPECT_DOUBLE_EQ(signed_distance_m(indexed_mesh(*mesh), {0.0, 0.0, 0.0}), -0.25);
  }
}

TEST_F(ReadMesh, ReadsTextStl) {
  const auto mesh = read_mesh(write("one.stl",
                                    "solid one\n facet normal 0 0 1\n  outer loop\r\n"
                                    "   vertex 0 0 0\n   vertex 1.5e0 0 0\n   vertex 0 +2 -1\n"
                                    "  endloop\n endfacet\nendsolid one\n"));
  ASSERT_TRUE(mesh) << mesh.error().describe();
  ASSERT_EQ(mesh->triangles.size(), 1U);
  EXPECT_EQ(mesh->vertices_m[1], Eigen::Vector3d(1.5, 0.0, 0.0));
  EXPECT_EQ(mesh->vertices_m[2], Eigen::Vector3d(0.0, 2.0, -1.0));
}

TEST_F(ReadMesh, ReadsObjPolygonsAndEveryFormOfIndex) {
  const auto mesh = read_mesh(write("quad.obj",
                                    "# a quad\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\n"
                                    "v 0 1 0\nvn 0 0 1\nf 1 2//1 3/1/1 -1\n"));
  ASSERT_TRUE(mesh) << mesh.error().describe();
  ASSERT_EQ(mesh->triangles.size(), 2U);
  EXPECT_EQ(mesh->triangles[0], Eigen::Vector3i(0, 1, 2));
  EXPECT_EQ(mesh->triangles[1], Eigen::Vector3i(0, 2, 3));
}

/// A square of 1 x 1 in quads and triangles, used twice: lifted by 3 within a node turned by 90
/// degrees about x, and mirrored in x by a node that stands elsewhere.
const std::string kCollada = R"(<?xml version="1.0"?>
<COLLADA version="1.4.1">
<asset><unit name="centimetre" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries>
<geometry id="square"><mesh>
<source id="corners"><float_array id="f" count="16">0 0 0 9 1 0 0 9
 1 1 0 9 0 1 0 9</float_array>
<technique_common><accessor source="#f" count="4" stride="4"/></technique_common></source>
<source id="up"><float_array id="g" count="3">0 0 1</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#corners"/></vertices>
<lines count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1</p></lines>
<polylist count="1"><input semantic="NORMAL" source="#up" offset="0"/>
<input semantic="VERTEX" source="#v" offset="1"/><vcount>4</vcount><p>0 0 0 1 0 2 0 3</p></polylist>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles>
<polygons count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></polygons>
</mesh></geometry>
</library_geometries>
<library_nodes><node id="mirrored"><matrix>-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>
<instance_geometry url="#square"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s">
<node><rotate>1 0 0 90</rotate><node><translate>0 0 3</translate><scale>2 1 1</scale>
<instance_geometry url="#square"/></node></node>
<node><instance_node url="#mirrored"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
)";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  return text.replace(text.find(what), what.size(), by);
}

TEST_F(ReadMesh, PlacesColladaInMetresByItsNodes) {
  const auto mesh = read_mesh(write("squares.dae", kCollada));
  ASSERT_TRUE(mesh) << mesh.error().describe();
  ASSERT_EQ(mesh->triangles.size(), 10U);
  const auto corners = [&](std::size_t t) {
    std::array<Eigen::Vector3d, 3> out;
    for (int k = 0; k < 3; ++k) {
      out[static_cast<std::size_t>(k)] =
          100.0 * mesh->vertices_m[static_cast<std::size_t>(mesh->triangles[t][k])];
    }
    return out;
  };
  // Turned about x: y is z now, z is -y. Stretched in x.
  const std::array<Eigen::Vector3d, 3> turned{
      {{0.0, -3.0, 0.0}, {2.0, -3.0, 1.0}, {0.0, -3.0, 1.0}}};
  for (const std::size_t t : {1, 3}) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_TRUE(corners(t)[k].isApprox(turned[k], 1e-12)) << corners(t)[k].transpose();
    }
  }
  // Mirrored, and the other way round with it.
  for (std::size_t t = 5; t < 10; ++t) {
    const auto [a, b, c] = corners(t);
    EXPECT_GT((b - a).cross(c - a).z(), 0.0);
    EXPECT_LE(std::max({a.x(), b.x(), c.x()}), 0.0);
  }
}

struct BadMesh {
  std::string name;
  std::string content;
  ErrorCode code;
  std::string says;
};

TEST_F(ReadMesh, NamesFileAndLineOfWhatIsWrong) {
  const std::string whole = binary_stl(triangulate(Box{{1.0, 1.0, 1.0}}), "binary");
  std::string not_finite = whole;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(not_finite.data() + 84 + 50 * 3 + 12, &nan, 4);
  const std::vector<BadMesh> cases = {
      {"short.stl", whole.substr(0, whole.size() - 7), ErrorCode::kConfig, "12 facets needs 684"},
      {"tiny.stl", "abc", ErrorCode::kConfig, "neither a text nor a binary"},
      {"empty.stl", "", ErrorCode::kConfig, "neither a text nor a binary"},
      {"nan.stl", not_finite, ErrorCode::kConfig, "facet 3 has a vertex that is not finite"},
      {"word.stl", "solid\nfacet normal 0 0 1\nvortex 1 2 3\n", ErrorCode::kConfig, ":3: 'vortex'"},
      {"two.stl", "solid\nvertex 0 0 0\nvertex 1 0 0\nendloop\n", ErrorCode::kConfig, ":4: "},
      {"nan_text.stl", "solid\nvertex 0 nan 0\n", ErrorCode::kConfig, ":2: "},
      {"cut.stl", "solid\nfacet normal 0 0 1\n", ErrorCode::kConfig, "before 'endsolid'"},
      {"none.stl", "solid\nendsolid\n", ErrorCode::kConfig, "no triangles"},
      {"range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ErrorCode::kConfig, ":4: '4' names no"},
      {"zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", ErrorCode::kConfig, "'0' names no"},
      {"huge.obj", "v 0 0 0\nf 1 99999999999999999999 1\n", ErrorCode::kConfig, ":2: "},
      {"few.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n", ErrorCode::kConfig, "at least 3"},
      {"short.obj", "v 0 0\n", ErrorCode::kConfig, ":1: "},
      {"what.ply", "ply", ErrorCode::kConfig, ".stl, .obj and .dae"},
      {"what.dae", "<xml/>", ErrorCode::kConfig, "no COLLADA"},
      {"open.dae", "<COLLADA>\n<scene>\n", ErrorCode::kConfig, "Error"},
      {"unit.dae", replaced(kCollada, "0.01", "-1"), ErrorCode::kConfig, ":3: a unit has"},
      {"scene.dae", replaced(kCollada, "<scene>", "<scenes>"), ErrorCode::kConfig, "Error"},
      {"lost.dae", replaced(kCollada, "url=\"#square", "url=\"#circle"), ErrorCode::kConfig,
       "'#circle' names no <geometry>"},
      {"nan.dae", replaced(kCollada, "0 0 0 9", "0 nan 0 9"), ErrorCode::kConfig,
       ":6: 'nan' is not a finite number"},
      {"cut.dae", replaced(kCollada, "0 0 0 9", "0 0 9"), ErrorCode::kConfig,
       ":6: <float_array> has 16 numbers, here 15"},
      {"few.dae", replaced(kCollada, "stride=\"4\"", "stride=\"5\""), ErrorCode::kConfig, ":8: "},
      {"range.dae", replaced(kCollada, "0 3</p>", "0 4</p>"), ErrorCode::kConfig,
       "4 names no vertex"},
      {"half.dae", replaced(kCollada, "0 1 2 0 2 3", "0 1 2 0 2"), ErrorCode::kConfig,
       "whole faces"},
      {"less.dae", replaced(kCollada, "count=\"2\"", "count=\"3\""), ErrorCode::kConfig,
       ":14: its count"},
      {"skin.dae", replaced(kCollada, "<instance_node", "<instance_controller"), ErrorCode::kConfig,
       ":23: <instance_controller> is not read"},
      {"strips.dae",
       replaced(replaced(kCollada, "<polygons", "<tristrips"), "polygons>", "tristrips>"),
       ErrorCode::kConfig, ":15: <tristrips> is not read"},
      {"circle.dae",
       replaced(kCollada, "<instance_geometry url=\"#square\"/></node></library",
                "<instance_node url=\"#mirrored\"/></node></library"),
       ErrorCode::kConfig, "within themselves"},
  };
  for (const BadMesh& bad : cases) {
    const auto mesh = read_mesh(write(bad.name, bad.content));
    ASSERT_FALSE(mesh) << bad.name;
    EXPECT_EQ(mesh.error().code, bad.code) << bad.name;
    EXPECT_THAT(mesh.error().describe(), HasSubstr(bad.says)) << bad.name;
    EXPECT_THAT(mesh.error().where, HasSubstr(bad.name));
  }
}

TEST_F(ReadMesh, SaysWhichFileDoesNotExist) {
  const auto mesh = read_mesh((folder_ / "absent.stl").string());
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(mesh.error().where, HasSubstr("absent.stl"));
}

}  // namespace
}  // namespace sidestep
