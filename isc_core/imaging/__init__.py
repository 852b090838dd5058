"""Operations on images and masks that know nothing of scenes."""
