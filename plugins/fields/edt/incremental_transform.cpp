#include "incremental_transform.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "row_scan.hpp"

namespace sidestep::edt {
namespace {

bool has_set(std::span<const std::uint8_t> flags) {
  return std::memchr(flags.data(), 1, flags.size()) != nullptr;
}

}  // namespace

IncrementalTransform::Workspace::Workspace(const Eigen::Vector3i& size, std::uint16_t cap)
    : row(static_cast<std::size_t>((size.x() + kTile - 1) / kTile * kTile)),
      envelope(std::max(size.y(), size.z()), cap),
      out_was(static_cast<std::size_t>(std::max(size.y(), size.z())) * kTile) {}

IncrementalTransform::IncrementalTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                                           Start start, WorkerPool& workers)
    : size_(size_vox),
      cap_(static_cast<std::uint16_t>(cap)),
      reach_(static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap)))) - 1),
      tiles_((size_vox.x() + kTile - 1) / kTile),
      workers_(workers),
      along_x_{Grid(size_vox), {}},
      along_y_{Grid(size_vox), {}},
      along_z_{Grid(size_vox), {}},
      along_x_was_(size_vox),
      along_y_was_(size_vox),
      slice_changed_(static_cast<std::size_t>(size_vox.z()), 0),
      line_changed_(static_cast<std::size_t>(size_vox.y()), 0),
      line_tiles_(static_cast<std::size_t>(size_vox.y()), 0),
      start_tile_(kTile, start == Start::kAllObstacles ? std::uint16_t{0} : cap_) {
  const std::size_t rows =
      static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(size_.z());
  for (Pass* pass : {&along_x_, &along_y_, &along_z_}) {
    pass->changed.assign(rows, 0);
    if (start == Start::kAllObstacles) continue;
    workers_.run(size_.z(), [&](int z) {
      for (int y = 0; y < size_.y(); ++y) std::fill_n(pass->values.row(y, z), size_.x(), cap_);
    });
  }
}

void IncrementalTransform::pass_row(const VoxelBits& obstacles, int y, int z, Workspace& space) {
  constexpr std::size_t kTileBytes = kTile * sizeof(std::uint16_t);
  const std::size_t row = row_index(y, z);
  scan_row(obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
           size_.x(), cap_, reach_, space.row.data());
  for (int tile = 0; tile < tiles_; ++tile) {
    const std::uint16_t* fresh = space.row.data() + tile * kTile;
    std::uint16_t* values = along_x_.values.row(y, z) + tile * kTile;
    if (std::memcmp(fresh, values, kTileBytes) == 0) continue;
    if (!is_first_) std::memcpy(along_x_was_.row(y, z) + tile * kTile, values, kTileBytes);
    std::memcpy(values, fresh, kTileBytes);
    along_x_.changed[row] |= std::uint64_t{1} << tile;
  }
}

bool IncrementalTransform::pass_line(const Line& line, const Pass& in, const Grid* in_was,
                                     Pass& out, Grid* out_was, Workspace& space) const {
  const auto mask_of = [&](int i) {
    return line.first_row + static_cast<std::size_t>(i) * line.row_step;
  };
  std::uint64_t tiles = 0;
  bool any = false;
  for (int i = 0; i < line.length; ++i) {
    tiles |= in.changed[mask_of(i)];
    out.changed[mask_of(i)] = 0;
  }
  for (; tiles != 0; tiles &= tiles - 1) {
    const int tile = std::countr_zero(tiles);
    const std::uint64_t bit = std::uint64_t{1} << tile;
    const std::ptrdiff_t x = tile * kTile;
    space.changed.clear();
    for (int i = 0; i < line.length; ++i) {
      if ((in.changed[mask_of(i)] & bit) != 0) space.changed.push_back(i);
    }
    TileLine column{.length = line.length,
                    .stride = line.stride,
                    .in = in.values.row(line.y, line.z) + x,
                    .in_was = start_tile_.data(),
                    .in_was_stride = 0,
                    .out = out.values.row(line.y, line.z) + x,
                    .out_was = space.out_was.data(),
                    .out_was_stride = kTile};
    if (in_was != nullptr) {
      column.in_was = in_was->row(line.y, line.z) + x;
      column.in_was_stride = line.stride;
    }
    if (out_was != nullptr) {
      column.out_was = out_was->row(line.y, line.z) + x;
      column.out_was_stride = line.stride;
    }
    const auto changed = space.envelope.update(column, space.changed);
    for (const int i : changed) out.changed[mask_of(i)] |= bit;
    any = any || !changed.empty();
  }
  return any;
}

std::span<const std::uint64_t> IncrementalTransform::update(
    const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed) {
  const auto ny = static_cast<std::size_t>(size_.y());
  Grid* const x_was = is_first_ ? nullptr : &along_x_was_;
  Grid* const y_was = is_first_ ? nullptr : &along_y_was_;
  workers_.run_banded(size_.z(), 1, [&](int begin, int end) {
    Workspace space(size_, cap_);
    for (int z = begin; z < end; ++z) {
      const auto rows = row_changed.subspan(row_index(0, z), ny);
      if (!has_set(rows) && slice_changed_[static_cast<std::size_t>(z)] == 0) continue;
      for (int y = 0; y < size_.y(); ++y) {
        along_x_.changed[row_index(y, z)] = 0;
        if (row_changed[row_index(y, z)] != 0) pass_row(obstacles, y, z, space);
      }
      const Line line{size_.y(), 0, z, row_index(0, z), 1, along_x_.values.pitch()};
      slice_changed_[static_cast<std::size_t>(z)] =
          pass_line(line, along_x_, x_was, along_y_, y_was, space) ? 1 : 0;
    }
  });
  find_changed_lines();
  workers_.run_banded(size_.y(), 1, [&](int begin, int end) {
    Workspace space(size_, cap_);
    for (int y = begin; y < end; ++y) {
      std::uint8_t& changed = line_changed_[static_cast<std::size_t>(y)];
      if (line_tiles_[static_cast<std::size_t>(y)] == 0 && changed == 0) continue;
      const Line line{size_.z(), y, 0, row_index(y, 0), ny, along_x_.values.slice_pitch()};
      changed = pass_line(line, along_y_, y_was, along_z_, nullptr, space) ? 1 : 0;
    }
  });
  is_first_ = false;
  return along_z_.changed;
}

void IncrementalTransform::find_changed_lines() {
  std::ranges::fill(line_tiles_, std::uint64_t{0});
  for (int z = 0; z < size_.z(); ++z) {
    if (slice_changed_[static_cast<std::size_t>(z)] == 0) continue;
    for (int y = 0; y < size_.y(); ++y) {
      line_tiles_[static_cast<std::size_t>(y)] |= along_y_.changed[row_index(y, z)];
    }
  }
}

}  // namespace sidestep::edt
