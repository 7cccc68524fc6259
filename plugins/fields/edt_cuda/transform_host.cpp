#include <algorithm>

#include "transform_on.hpp"

namespace sidestep::edt_cuda {
namespace {

constexpr int kSide = cuda::kBlockSide;

int parts(int length, int unit) { return (length + unit - 1) / unit; }

std::size_t product(int a, int b, int c) {
  return static_cast<std::size_t>(a) * static_cast<std::size_t>(b) * static_cast<std::size_t>(c);
}

/// The marked parts, in the order of slabs, segments and tiles.
void list(const std::vector<std::uint8_t>& marks, int tiles, int segments,
          std::vector<LinePart>& out) {
  out.clear();
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] == 0) continue;
    const int at = static_cast<int>(i);
    out.push_back({at % tiles, at / tiles % segments, at / (tiles * segments)});
  }
}

}  // namespace

DirtyRegion::DirtyRegion(const Shape& shape, int reach)
    : shape_(shape),
      reach_(reach),
      tiles_(parts(shape.size.x, cuda::kWarp)),
      segments_y_(parts(shape.size.y, kSegment)),
      segments_z_(parts(shape.size.z, kSegment)),
      rows_(product(shape.blocks.y, shape.blocks.z, 1)),
      along_y_(product(tiles_, segments_y_, shape.blocks.z)),
      along_z_(product(tiles_, segments_z_, shape.blocks.y)) {}

DirtyRegion::Range DirtyRegion::reached(int block, int length, int unit) const {
  const int first = std::max(0, block * kSide - reach_);
  const int last = std::min(length - 1, block * kSide + kSide - 1 + reach_);
  return {first / unit, last / unit};
}

void DirtyRegion::mark(std::int32_t block) {
  const int bx = block % shape_.blocks.x;
  const int by = block / shape_.blocks.x % shape_.blocks.y;
  const int bz = block / (shape_.blocks.x * shape_.blocks.y);
  const Range tiles = reached(bx, shape_.size.x, cuda::kWarp);
  const auto mark_tiles = [&](std::vector<std::uint8_t>& marks, std::size_t line) {
    const auto begin =
        marks.begin() + static_cast<std::ptrdiff_t>(line * static_cast<std::size_t>(tiles_));
    std::fill(begin + tiles.first, begin + tiles.last + 1, std::uint8_t{1});
  };
  rows_[product(by, 1, 1) + product(shape_.blocks.y, bz, 1)] = 1;
  const Range along_y = reached(by, shape_.size.y, kSegment);
  for (int segment = along_y.first; segment <= along_y.last; ++segment) {
    mark_tiles(along_y_, static_cast<std::size_t>(segment) + product(segments_y_, bz, 1));
  }
  const Range slabs = reached(by, shape_.size.y, kSide);
  const Range along_z = reached(bz, shape_.size.z, kSegment);
  for (int slab = slabs.first; slab <= slabs.last; ++slab) {
    for (int segment = along_z.first; segment <= along_z.last; ++segment) {
      mark_tiles(along_z_, static_cast<std::size_t>(segment) + product(segments_z_, slab, 1));
    }
  }
}

const DirtyLines& DirtyRegion::of(std::span<const std::int32_t> blocks) {
  const int longest = std::max({shape_.size.x, shape_.size.y, shape_.size.z});
  if (!blocks.empty() && reach_ >= longest) return everything();
  for (std::vector<std::uint8_t>* marks : {&rows_, &along_y_, &along_z_}) {
    std::ranges::fill(*marks, std::uint8_t{0});
  }
  for (const std::int32_t block : blocks) mark(block);
  lines_.rows.clear();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i] != 0) lines_.rows.push_back(static_cast<std::int32_t>(i));
  }
  list(along_y_, tiles_, segments_y_, lines_.along_y);
  list(along_z_, tiles_, segments_z_, lines_.along_z);
  return lines_;
}

const DirtyLines& DirtyRegion::everything() {
  for (std::vector<std::uint8_t>* marks : {&rows_, &along_y_, &along_z_}) {
    std::ranges::fill(*marks, std::uint8_t{1});
  }
  lines_.rows.resize(rows_.size());
  for (std::size_t i = 0; i < rows_.size(); ++i) lines_.rows[i] = static_cast<std::int32_t>(i);
  list(along_y_, tiles_, segments_y_, lines_.along_y);
  list(along_z_, tiles_, segments_z_, lines_.along_z);
  return lines_;
}

Result<std::unique_ptr<DistanceTransform>> make_host_transform(const TransformSettings& settings,
                                                               cuda::HostBackend backend) {
  return make_transform_on(settings, std::make_unique<cuda::HostBackend>(backend));
}

}  // namespace sidestep::edt_cuda
