#include <sidestep/report/canvas.hpp>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <numbers>
#include <system_error>

#include <cairo-svg.h>
#include <cairo.h>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr const char* kFont = "DejaVu Sans";

struct Destroy {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};
using Surface = std::unique_ptr<cairo_surface_t, Destroy>;
using Context = std::unique_ptr<cairo_t, Destroy>;

void set_colour(cairo_t* context, const Colour& colour) {
  cairo_set_source_rgba(context, colour.red, colour.green, colour.blue, colour.alpha);
}

void set_font(cairo_t* context, const TextStyle& style) {
  cairo_select_font_face(context, kFont, CAIRO_FONT_SLANT_NORMAL,
                         style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, style.size);
}

/// One pixel as Cairo stores it: alpha, then colours multiplied by it.
std::uint32_t packed(const Colour& colour) {
  const auto byte = [](double value) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0, 1.0) * 255.0));
  };
  return byte(colour.alpha) << 24 | byte(colour.red * colour.alpha) << 16 |
         byte(colour.green * colour.alpha) << 8 | byte(colour.blue * colour.alpha);
}

/// `errno` was 0 before, and tells why Cairo could not write.
Result<void> written(cairo_status_t status, const std::filesystem::path& file) {
  if (status == CAIRO_STATUS_SUCCESS) return {};
  const std::string reason = errno != 0 ? ": " + std::generic_category().message(errno) : "";
  return fail(ErrorCode::kIo,
              std::string("cannot write the picture: ") + cairo_status_to_string(status) + reason,
              file.string());
}

}  // namespace

struct Canvas::Impl {
  Surface surface;
  Context context;

  void rectangle(const Area& area) const {
    cairo_rectangle(context.get(), area.x, area.y, area.width, area.height);
  }
  void circle(const Point& centre, double radius) const {
    cairo_new_path(context.get());
    cairo_arc(context.get(), centre.x, centre.y, radius, 0.0, 2.0 * std::numbers::pi);
  }
  void fill(const Colour& colour) const {
    set_colour(context.get(), colour);
    cairo_fill(context.get());
  }
  void draw(const Stroke& stroke) const {
    set_colour(context.get(), stroke.colour);
    cairo_set_line_width(context.get(), stroke.width);
    cairo_set_dash(context.get(), stroke.dashes.data(), static_cast<int>(stroke.dashes.size()),
                   0.0);
    cairo_set_line_join(context.get(), CAIRO_LINE_JOIN_ROUND);
    cairo_stroke(context.get());
  }
  /// The picture so far, `scale` times as large, on another surface.
  cairo_status_t paint_on(cairo_surface_t* other, double scale) const {
    const Context painter(cairo_create(other));
    cairo_scale(painter.get(), scale, scale);
    cairo_set_source_surface(painter.get(), surface.get(), 0.0, 0.0);
    cairo_paint(painter.get());
    return cairo_status(painter.get());
  }
};

Canvas::Canvas(double width, double height)
    : width_(width), height_(height), impl_(std::make_unique<Impl>()) {
  const cairo_rectangle_t extents{0.0, 0.0, width, height};
  impl_->surface.reset(cairo_recording_surface_create(CAIRO_CONTENT_COLOR_ALPHA, &extents));
  impl_->context.reset(cairo_create(impl_->surface.get()));
  rectangle({0.0, 0.0, width, height}, colour(0xFFFFFF));
}
Canvas::~Canvas() = default;
Canvas::Canvas(Canvas&&) noexcept = default;
Canvas& Canvas::operator=(Canvas&&) noexcept = default;

void Canvas::line(std::span<const Point> points, const Stroke& stroke) {
  cairo_t* context = impl_->context.get();
  cairo_new_path(context);
  for (const Point& point : points) {
    if (std::isfinite(point.x) && std::isfinite(point.y)) {
      cairo_line_to(context, point.x, point.y);
    } else {
      cairo_new_sub_path(context);  // a gap
    }
  }
  impl_->draw(stroke);
}

void Canvas::rectangle(const Area& area, const Colour& fill) {
  impl_->rectangle(area);
  impl_->fill(fill);
}

void Canvas::outline(const Area& area, const Stroke& stroke) {
  impl_->rectangle(area);
  impl_->draw(stroke);
}

void Canvas::polygon(std::span<const Point> corners, const Colour& fill) {
  cairo_new_path(impl_->context.get());
  for (const Point& corner : corners) cairo_line_to(impl_->context.get(), corner.x, corner.y);
  impl_->fill(fill);
}

void Canvas::circle(const Point& centre, double radius, const Colour& fill) {
  impl_->circle(centre, radius);
  impl_->fill(fill);
}

void Canvas::ring(const Point& centre, double radius, const Stroke& stroke) {
  impl_->circle(centre, radius);
  impl_->draw(stroke);
}

void Canvas::text(const Point& at, const std::string& text, const TextStyle& style) {
  cairo_t* context = impl_->context.get();
  const double width = text_width(text, style);
  const double shift = style.align == Align::kLeft     ? 0.0
                       : style.align == Align::kCentre ? -0.5 * width
                                                       : -width;
  cairo_save(context);
  set_font(context, style);
  set_colour(context, style.colour);
  cairo_translate(context, at.x, at.y);
  if (style.upwards) cairo_rotate(context, -0.5 * std::numbers::pi);
  cairo_move_to(context, shift, 0.0);
  cairo_show_text(context, text.c_str());
  cairo_restore(context);
}

double Canvas::text_width(const std::string& text, const TextStyle& style) {
  cairo_t* context = impl_->context.get();
  cairo_text_extents_t extents;
  cairo_save(context);
  set_font(context, style);
  cairo_text_extents(context, text.c_str(), &extents);
  cairo_restore(context);
  return extents.x_advance;
}

void Canvas::raster(const Raster& raster, const Area& area) {
  if (raster.width <= 0 || raster.height <= 0) return;
  const Surface image(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, raster.width, raster.height));
  if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS) return;
  cairo_surface_flush(image.get());
  unsigned char* bytes = cairo_image_surface_get_data(image.get());
  const int stride = cairo_image_surface_get_stride(image.get());
  for (int y = 0; y < raster.height; ++y) {
    auto* row = reinterpret_cast<std::uint32_t*>(bytes + static_cast<std::ptrdiff_t>(y) * stride);
    for (int x = 0; x < raster.width; ++x) {
      row[x] = packed(raster.pixels[idx(y) * idx(raster.width) + idx(x)]);
    }
  }
  cairo_surface_mark_dirty(image.get());
  clip(area);
  cairo_t* context = impl_->context.get();
  cairo_translate(context, area.x, area.y);
  cairo_scale(context, area.width / raster.width, area.height / raster.height);
  cairo_set_source_surface(context, image.get(), 0.0, 0.0);
  cairo_pattern_set_filter(cairo_get_source(context), CAIRO_FILTER_NEAREST);
  cairo_paint(context);
  unclip();
}

void Canvas::clip(const Area& area) {
  cairo_save(impl_->context.get());
  impl_->rectangle(area);
  cairo_clip(impl_->context.get());
}

void Canvas::unclip() { cairo_restore(impl_->context.get()); }

Result<void> Canvas::write_png(const std::filesystem::path& file, double scale) const {
  const Surface image(cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                                 static_cast<int>(std::ceil(width_ * scale)),
                                                 static_cast<int>(std::ceil(height_ * scale))));
  if (const auto status = impl_->paint_on(image.get(), scale); status != CAIRO_STATUS_SUCCESS) {
    return written(status, file);
  }
  errno = 0;
  return written(cairo_surface_write_to_png(image.get(), file.c_str()), file);
}

Result<void> Canvas::write_svg(const std::filesystem::path& file) const {
  errno = 0;
  const Surface surface(cairo_svg_surface_create(file.c_str(), width_, height_));
  impl_->paint_on(surface.get(), 1.0);
  cairo_surface_finish(surface.get());
  return written(cairo_surface_status(surface.get()), file);
}

}  // namespace sidestep
