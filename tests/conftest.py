from hypothesis import settings

# No deadline: on a busy machine any example may take long once.
settings.register_profile("surfsup", deadline=None)
settings.load_profile("surfsup")
