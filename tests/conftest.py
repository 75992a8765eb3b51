import os
import tempfile

from hypothesis import settings

# No deadline: on a busy machine any example may take long once.
settings.register_profile("surfsup", deadline=None)
settings.load_profile("surfsup")

# Tests keep no grids and maps in the cache of the user.
_CACHE = tempfile.TemporaryDirectory(prefix="surfsup-cache-")
os.environ["SURFSUP_CACHE"] = _CACHE.name
