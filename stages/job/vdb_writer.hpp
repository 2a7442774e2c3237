// Writes an OpenVDB file grid by grid, so that one grid is in memory at a time.
#pragma once

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/openvdb.h>

#include <fstream>
#include <string>

namespace npg
{

// The bytes are those of openvdb::io::File::write() with the same grids, which takes them all at once: the
// two upper nodes of a float grid alone are 0.3 MB however few values it has, and a set of latent grids is
// hundreds of them.  Names of grids must differ; no tree belongs to two grids.
class vdb_writer : private openvdb::io::Archive
{
  public:
    vdb_writer(const std::string &path, const openvdb::MetaMap &about, int32_t grid_count)
    {
        setCompression(openvdb::io::COMPRESS_ACTIVE_MASK); // noise in single precision: nothing to gain
        out.exceptions(std::ios::failbit | std::ios::badbit);
        out.open(path, std::ios::binary | std::ios::trunc);
        openvdb::io::setDataCompression(out, compression());
        openvdb::io::setWriteGridStatsMetadata(out, isGridStatsMetadataEnabled());
        writeHeader(out, true);
        about.writeMeta(out);
        out.write(reinterpret_cast<const char *>(&grid_count), sizeof grid_count);
    }

    void add(const openvdb::GridBase::ConstPtr &grid)
    {
        openvdb::io::GridDescriptor descriptor(grid->getName(), grid->type(), grid->saveFloatAsHalf());
        writeGrid(descriptor, grid, out, true);
        openvdb::io::setDataCompression(out, compression()); // a grid may have changed it for itself
    }

    void close() { out.close(); }

  private:
    std::ofstream out;
};

} // namespace npg
